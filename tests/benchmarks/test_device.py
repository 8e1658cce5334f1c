"""The benchmark of a device: it measures the driver that is configured, and pushes nothing that a hand would feel."""

from __future__ import annotations

import ctypes
import json
from pathlib import Path
from typing import Any

import pytest

from hapticd import cli
from hapticd.config.loading import parse
from hapticd_bench.device import MOST_N, without_push
from tests.drivers.haply.service import FakeService
from tests.drivers.rig.device import Rig, build

ATTEMPTS = 5
"""A computer that is away for 50 ms stops any real device's loop."""

LAB = """
[loop]
rate_hz = 500.0
[device]
driver = "{driver}"
{device}
[[scene.walls]]
axis = "x"
position_m = 0.02
stiffness_n_per_m = 9000.0
[controller]
law = "tdpa"
[safety]
max_axis_force_n = 7.0
"""


def measured(text: str, directory: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    config = directory / "lab.toml"
    config.write_text(text)
    for _ in range(ATTEMPTS):
        with pytest.raises(SystemExit) as ended:
            cli.main(["bench", "device", "--config", str(config), "--quick", "--json"])
        said = capsys.readouterr()
        if not ended.value.code:
            break
    assert not ended.value.code, said.err
    found: dict[str, Any] = json.loads(said.out)
    return found


@pytest.fixture(scope="module")
def rig_core(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build(tmp_path_factory.mktemp("core"))


def test_a_driver_is_measured_beside_the_simulated_device_and_never_pushes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with FakeService() as service:
        device = f'accept_no_watchdog = true\n[device.options]\nurl = "{service.url}"'
        found = measured(LAB.format(driver="inverse3", device=device), tmp_path, capsys)
        assert 0.0 < service.peak_n <= MOST_N * (1.0 + 1e-12)  # the norm of components that were rounded
        assert service.messages > 2 * 200
        assert service.cursor.force_n == [0.0, 0.0, 0.0]
    assert (found["driver"], found["rate_hz"], found["disarmed"]) == ("inverse3", 500.0, "")
    own, simulated = found["device_us"], found["simulated_us"]
    assert own["count"] == simulated["count"] == found["read_us"]["count"] == found["write_us"]["count"] == 200
    assert found["p50_ratio"] == own["p50"] / simulated["p50"]
    assert 0.0 < found["read_us"]["p50"] < own["max"]
    assert found["write_us"]["p50"] > 0.0


def test_a_device_that_may_not_be_armed_is_read_and_says_why(
    rig_core: ctypes.CDLL, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Rig(rig_core, tmp_path / "port", pace="real") as rig:
        device = f'[device.options]\nport = "{rig.port}"\nsign_checked = true'
        found = measured(LAB.format(driver="serial-rig", device=device), tmp_path, capsys)
    assert "hapticd calibrate" in found["disarmed"]
    assert found["device_us"]["count"] == 200
    assert found["write_us"]["count"] == 0


def test_what_runs_has_the_device_the_rate_and_the_law_of_the_file_and_no_scene() -> None:
    options = 'options.model = "omega7"\noptions.max_force_n = 5.0'
    loaded = parse("\ufeff" + LAB.format(driver="loopback", device=options), "lab.toml")  # as Windows writes it
    for simulated in (False, True):
        made = without_push(loaded, simulated).config
        assert (made.loop.rate_hz, made.controller.law, made.device.driver) == (500.0, "tdpa", "loopback")
        assert (made.safety.max_force_n, made.safety.max_axis_force_n) == (MOST_N, None)
        (wall,) = made.scene.walls
        assert (wall.axis, wall.position_m, wall.stiffness_n_per_m) == ("x", 10.0, 1.0)
    assert without_push(loaded).options.model_dump()["max_force_n"] == 5.0
    assert without_push(loaded, simulated=True).options.model_dump()["max_force_n"] != 5.0
