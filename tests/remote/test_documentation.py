"""docs/remote.md is right about the wire, and its programs do what they say."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from hapticd.client.remote import DrivenState, RemoteState
from hapticd.remote import message
from hapticd.remote.delays import DELAY_EDGES_MS
from hapticd.remote.scene_socket import SCHEMA
from hapticd.tick.remote.port_state import PortState
from tests.remote.stage import drives_the_tool

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "remote.md").read_text()


def table(after: str) -> set[str]:
    """The keys of the first table behind a line."""
    rows = re.findall(
        r"^\| (`.+?`) \|", PAGE[PAGE.index(after) :].split("\n\n- ")[0].split("\n\nOf each")[0], re.MULTILINE
    )
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


def test_the_keys_of_a_message_are_those_that_are_taken() -> None:
    taken = {key for kind in message._KEYS.values() for key in kind}
    assert table("what a client says") == taken | message._SAID_OF


def test_the_keys_of_a_state_are_those_that_are_told() -> None:
    assert table("what the device does") == set(RemoteState.__dataclass_fields__) - {"port"}
    ports = PAGE[PAGE.index("Of each port:") :]
    keys = re.findall(r"^\| `(\w+)` \|", ports[: ports.index("### ")], re.MULTILINE)
    assert set(keys) == set(DrivenState.__dataclass_fields__)
    for state in PortState:
        assert f"`{state.name.lower()}`" in ports


def test_the_figures_of_the_page_are_those_of_the_code() -> None:
    assert f"schema {SCHEMA}." in PAGE
    assert f"-{message.FARTHEST_M:g} to {message.FARTHEST_M:g}" in PAGE
    assert f"-{message.FASTEST_TURN_RAD_PER_S:g} to {message.FASTEST_TURN_RAD_PER_S:g}" in PAGE
    assert ", ".join(f"{edge:g}" for edge in DELAY_EDGES_MS[:-1]) + f" and {DELAY_EDGES_MS[-1]:g} ms" in PAGE


@pytest.mark.parametrize(("language", "name"), [("cpp", "drive.cpp"), ("js", "javascript/drive.mjs")])
def test_the_page_shows_the_clients_as_they_are(language: str, name: str) -> None:
    assert f"`docs/examples/{name}`:\n\n```{language}\n{(DOCS / 'examples' / name).read_text()}```\n" in PAGE


def test_the_cpp_client_drives_a_running_daemon(tmp_path: Path) -> None:
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/nlohmann/json.hpp").exists():
        pytest.skip("apt install g++ libzmq3-dev nlohmann-json3-dev")
    source = DOCS / "examples" / "drive.cpp"
    built = subprocess.run(
        [compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", tmp_path / "drive", source, "-lzmq"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    drives_the_tool([tmp_path / "drive"])


def test_the_python_clients_compile() -> None:
    blocks = re.findall(r"```python\n(.+?)```", PAGE, flags=re.DOTALL)
    assert blocks
    for block in blocks:
        compile(block, "remote.md", "exec")
