"""The soak: what it sees in a sound daemon, and in one that leaks."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.cli import main
from hapticd.errors import ConfigError
from hapticd.measure import Bar
from hapticd_bench.soak import STOPPED_S, Soak, measure

CONFIG = """
[device.options]
model = "omega7"
hand = { force = { profile = "constant", newton = -3.0 } }
[[scene.walls]]
stiffness_n_per_m = 12000.0
"""

LEAKING_LAW = '''
"""A law that keeps a kilobyte of every tick."""
from hapticd.law import LawParams
KEPT = []
class Params(LawParams):
    """None."""
class State:
    """Nothing."""
    asked: int
def start(state, params, snapshot):
    """Nothing."""
def step(state, params, tick):
    """Keep and keep."""
    KEPT.append(bytes(1000))
    return tick.contact_n
'''


def soak(directory: Path, config: str, duration_s: float, interval_s: float) -> Soak:
    path = directory / "lab.toml"
    path.write_text(config)
    return measure(path, duration_s, interval_s, lambda _: None)


def bar(found: Soak, name: str) -> Bar:
    return next(bar for bar in found.bars if name in bar.name)


def test_every_tick_is_seen_and_on_the_beat(tmp_path: Path) -> None:
    found = soak(tmp_path, CONFIG, 4.0, 1.0)
    assert len(found.looks) == 4
    assert bar(found, "did not come").measured == bar(found, "not fetched").measured == 0
    assert bar(found, "off the beat").measured == 0
    end_s = found.looks[-1].end_s  # a loop that was late ends with the first deadline it makes after these 4 s
    assert end_s >= 4.0
    assert sum(look.ticks + look.skipped for look in found.looks) == 1 + round((STOPPED_S + end_s) * 1000)
    assert found.faults == ()


def test_a_leak_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mylab").mkdir()
    (tmp_path / "mylab/leaking.py").write_text(LEAKING_LAW)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    found = soak(tmp_path, CONFIG + '[controller]\nlaw = "mylab.leaking"\n', 4.0, 1.0)
    assert bar(found, "control: memory gained").verdict == "FAIL"
    assert bar(found, "control: memory gained").measured > 2000


@pytest.mark.nightly
def test_ten_minutes_leave_nothing_behind(tmp_path: Path) -> None:
    found = soak(tmp_path, CONFIG, 600.0, 40.0)
    assert all(bar.verdict == "PASS" for bar in found.bars), found.bars


def test_a_daemon_that_does_not_publish_every_tick_is_refused_before_it_starts(tmp_path: Path) -> None:
    """Whoever counts ticks would take those for lost."""
    with pytest.raises(ConfigError, match=r"lab\.toml: telemetry\.every_ticks = 10: .*set it to 1"):
        soak(tmp_path, f"{CONFIG}\n[telemetry]\nevery_ticks = 10\n", 1.0, 1.0)


@pytest.mark.parametrize("duration", ["inf", "nan", "1e300"])
def test_a_duration_without_end_is_refused(duration: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["bench", "soak", "--duration", duration])
    assert ended.value.code == 2
    assert "'--duration': Input should be " in capsys.readouterr().err
