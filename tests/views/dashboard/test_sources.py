"""The page's own files, and what it takes from others."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "views" / "hapticd_views" / "dashboard" / "page"
MODULES = sorted(PAGE.glob("*.js"))


def test_what_comes_from_others_is_named_with_its_exact_version_and_hash() -> None:
    wanted = json.loads((ROOT / "views" / "package.json").read_text())["dependencies"]
    locked = json.loads((ROOT / "views" / "package-lock.json").read_text())["packages"]
    assert locked.pop("")["dependencies"] == wanted
    assert [name.removeprefix("node_modules/") for name in locked] == [*wanted]
    for name, package in locked.items():
        assert package["version"] == wanted[name.removeprefix("node_modules/")]
        kind, digest = package["integrity"].split("-", 1)
        assert (kind, len(base64.b64decode(digest))) == ("sha512", 64)


def test_nothing_of_others_is_committed() -> None:
    listed = subprocess.run(["git", "ls-files", "views"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert not [line for line in listed.splitlines() if "vendor" in line or "node_modules" in line]


def test_every_module_is_well_formed_and_small() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node")
    for module in MODULES:
        subprocess.run([node, "--check", module], check=True)
        assert len(module.read_text().splitlines()) <= 250, module.name


def test_the_page_names_nothing_that_is_elsewhere_and_holds_no_script_or_style() -> None:
    for path in [*MODULES, *PAGE.glob("*.css"), PAGE / "index.html"]:
        text = path.read_text()
        assert not re.search(r"https?://|@import|url\(", text), path.name
    html = (PAGE / "index.html").read_text()
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son\w+=", html)


def test_what_a_daemon_says_is_never_taken_for_html() -> None:
    """The one use of innerHTML is of a constant."""
    uses = [line for module in MODULES for line in module.read_text().splitlines() if "HTML" in line]
    assert len(uses) == 1
    assert "${" not in uses[0]


def test_every_module_is_used() -> None:
    imported = {"main.js"}
    for module in MODULES:
        imported |= set(re.findall(r'from "\./([\w-]+\.js)"', module.read_text()))
    assert imported == {module.name for module in MODULES}
