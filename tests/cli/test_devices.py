"""`hapticd devices` as a shell sees it: what is there, whether it can be used, and what to do."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.drivers.plugin import install, write_module

HAPTICD = str(Path(sys.executable).with_name("hapticd"))


def hapticd(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, *map(str, arguments)], capture_output=True, text=True, check=False,
        env={**os.environ, "COLUMNS": "120"},
    )  # fmt: skip


def listed(*arguments: str | Path) -> dict[str, Any]:
    done = hapticd("devices", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    return {row["name"]: row for row in json.loads(done.stdout)}


def test_each_device_has_a_line_and_below_it_what_is_to_be_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = "FoundDevice('good', '1'), FoundDevice('new', '2', '1-3', note='fresh from the box')"
    bad = "FoundDevice('bad', '', '1-4', 'nobody may open it', mend=('sudo chmod it',))"
    install(tmp_path, monkeypatch, f"find(cls, options=None): return [{devices}, {bad}]")
    shown = hapticd("devices").stdout.splitlines()
    assert shown[0].split() == ["driver", "device", "serial", "where", "state"]
    at = next(number for number, line in enumerate(shown) if line.startswith("odd"))
    good, new, note, bad, why, mend = (" ".join(line.split()) for line in shown[at : at + 6])
    assert good == "odd good 1 - ready"
    assert (new, note) == ("odd new 2 1-3 usable", "fresh from the box")
    assert (bad, why) == ("odd bad - 1-4 cannot be used", "nobody may open it")
    assert mend.removeprefix("sudo ") == "chmod it"
    assert ["loopback", "omega7", "model,", "simulated", "-", "-", "ready"] in [line.split() for line in shown]


def test_every_driver_of_ours_is_asked_and_says_what_to_do_where_it_finds_none() -> None:
    rows = listed()
    families = {"omega7", "serial-rig", "hid-rig", "moteus", "odrive", "inverse3"}
    assert {"loopback", *families} <= rows.keys()
    assert not [name for name in families if rows[name].get("problem")]
    shown = hapticd("devices").stdout
    for name in families:
        assert re.search(rf"^{name} ", shown, re.MULTILINE), name


def test_a_driver_that_found_none_says_what_to_do_and_what_this_computer_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacks = "Diagnosis('ok', 'well'), Diagnosis('problem', 'no library', ('apt install it',))"
    install(
        tmp_path, monkeypatch,
        "find(cls, options=None): return []", f"diagnose(cls, options=None): return [{lacks}]",
    )  # fmt: skip
    shown = hapticd("devices").stdout
    assert "none found\n    plug it in\n    no library\n    apt install it\n" in shown
    assert "well" not in shown
    assert [one["mark"] for one in listed()["odd"]["diagnoses"]] == ["ok", "problem"]


def test_of_a_driver_that_does_not_look_it_is_not_said_that_it_found_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`plug it in` was said of a device that the driver drove."""
    (tmp_path / "mylab").mkdir()
    (tmp_path / "mylab" / "rig.py").write_text(
        "from hapticd.driver import Driver\n"
        "class Rig(Driver):\n"
        "    def _open(self): raise OSError\n"
        "    def _enable(self): pass\n"
        "    def _read(self): pass\n"
        "    def _write(self, force_n): pass\n"
        "    def _disable(self): pass\n"
        "    def _close(self): pass\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    shown = hapticd("devices", "mylab.rig").stdout
    assert "does not look\n    it has no `find`" in shown
    assert "none found" not in shown
    assert "plug it in" not in shown
    assert listed("mylab.rig")["mylab.rig"]["looks"] is False
    assert listed("loopback")["loopback"]["looks"] is True


@pytest.mark.parametrize("find", ["raise ValueError('odd')", "os.abort()"])
def test_a_driver_that_fails_is_told_beside_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, find: str
) -> None:
    install(tmp_path, monkeypatch, f"find(cls, options=None): {find}")
    rows = listed()
    assert rows["odd"]["problem"]
    assert rows["loopback"]["problem"] == ""
    assert rows["loopback"]["devices"][0]["model"] == "omega7 model, simulated"
    shown = hapticd("devices")
    assert shown.returncode == 0
    assert "could not look" in shown.stdout
    assert "ready" in shown.stdout


def test_one_driver_is_asked_alone_and_its_options_follow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "find(cls, options=None): return []")
    shown = hapticd("devices", "loopback").stdout
    assert "odd" not in shown
    assert "mass_kg" in shown
    assert "mass_kg" not in hapticd("devices").stdout


def test_the_configuration_tells_its_driver_where_to_look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "find(cls, options=None): return [FoundDevice(repr(options and options.seed), '')]")
    config = tmp_path / "lab.toml"
    config.write_text('[device]\ndriver = "odd"\n[device.options]\nseed = 42\n')
    assert listed("--config", config)["odd"]["devices"][0]["model"] == "42"
    assert listed()["odd"]["devices"][0]["model"] == "None"


def test_a_configuration_that_cannot_be_used_is_refused_when_it_was_asked_for(tmp_path: Path) -> None:
    config = tmp_path / "lab.toml"
    config.write_text("[loop]\nrate_hz = 0\n")
    done = hapticd("devices", "--config", config)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"hapticd: {config}: loop.rate_hz" in done.stderr


def test_a_driver_that_is_named_by_its_module_is_listed_when_it_is_configured_or_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_module(
        tmp_path, monkeypatch, "find(cls, options=None): return [FoundDevice(repr(options and options.seed), '')]"
    )
    config = tmp_path / "lab.toml"
    config.write_text('[device]\ndriver = "mylab.rig"\n[device.options]\nseed = 42\n')
    assert listed("--config", config)["mylab.rig"]["devices"][0]["model"] == "42"
    assert "mylab.rig" not in listed()
    assert listed("mylab.rig")["mylab.rig"]["devices"][0]["model"] == "None"
    assert hapticd("devices", "mylab.nothing").returncode == 2
