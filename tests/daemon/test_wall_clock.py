"""The time of day is for timestamps only: set back or ahead, it changes nothing that a hand feels or a client asks."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from hapticd.client.commands import command
from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED

ROOT = Path(__file__).parent.parent.parent
HOUR_S = 3600.0

WALL_CLOCK = {"time", "time_ns", "now", "utcnow", "today", "CLOCK_REALTIME", "CLOCK_TAI"}
"""Names of `time` and `datetime` by which the time of day is read."""

STAMPS = {
    "hapticd/telemetry/clock.py": "the timestamps of telemetry, once a second",
    "views/hapticd_views/commands/record.py": "the name of a recording",
    "views/hapticd_views/lsl/bridge.py": "telemetry's timestamps back to LSL's clock",
    "views/hapticd_views/recording/recorder.py": "when a recording began",
}
"""The modules that may, and what for."""

FOLDERS = ("hapticd", "drivers/hapticd_drivers", "controllers/hapticd_controllers", "views/hapticd_views")

# What `hapticd run` finds on its path: a time of day that is as far off as a file says.
SET_CLOCK = """
import pathlib, time
real_ns, real_s = time.time_ns, time.time
def ahead_s():
    return float(pathlib.Path(__file__).with_name("ahead").read_text())
time.time_ns = lambda: real_ns() + int(1e9 * ahead_s())
time.time = lambda: real_s() + ahead_s()
"""


def readings(tree: ast.AST) -> list[ast.Attribute]:
    """Where source reads the time of day."""
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and node.attr in WALL_CLOCK
        and isinstance(node.value, ast.Name)
        and node.value.id in ("time", "datetime", "date")
    ]


def test_the_time_of_day_is_read_for_timestamps_only() -> None:
    reading: set[str] = set()
    for path in [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]:
        text = path.read_text()
        if "time" not in text:
            continue
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module == "time":
                assert not WALL_CLOCK & {name.name for name in node.names}, f"{path}: by another name"
        if readings(tree):
            reading.add(path.relative_to(ROOT).as_posix())
    assert reading == set(STAMPS)


def test_the_walk_finds_each_way_to_read_it() -> None:
    ways = ("time.time()", "time.time_ns()", "time.clock_gettime(time.CLOCK_REALTIME)", "datetime.now(UTC)")
    assert [len(readings(ast.parse(way))) for way in ways] == [1, 1, 1, 1]
    assert not readings(ast.parse("time.monotonic(); time.sleep(1); record.time_ns"))


def test_a_clock_that_is_set_costs_no_tick_no_request_and_no_order_of_timestamps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text(SET_CLOCK)
    clock = tmp_path / "ahead"
    clock.write_text("0")

    def set_clock(ahead_s: float) -> None:
        clock.with_suffix(".new").write_text(str(ahead_s))
        clock.with_suffix(".new").replace(clock)

    with Daemon(PRESSED, pythonpath=tmp_path) as daemon:
        daemon.wait_ready()
        monkeypatch.setenv("HAPTICD_RUNTIME_DIR", str(daemon.directory / "run"))
        with Subscriber(daemon.endpoint, "hapticd/position", "hapticd/status") as subscriber:
            stamps: dict[str, list[float]] = {"hapticd/position": [], "hapticd/status": []}
            seqs: list[int] = []
            began_s = subscriber.until("hapticd/status", armed=True)["timestamp"]
            for ahead_s in (-HOUR_S, HOUR_S, -HOUR_S):
                set_clock(ahead_s)
                command("disarm")
                command("arm")
                statuses = 0
                for topic, fields in subscriber.maps():
                    stamps[topic].append(fields["timestamp"])
                    if topic == "hapticd/position":
                        seqs.append(fields["seq"])
                    elif fields["armed"]:
                        statuses += 1
                    if statuses == 3:  # it has looked at the clock by then
                        break
            last = command("status")["status"]
        assert daemon.output().count("the clock went ahead by 3600") == 1, "set ahead it is followed, and never back"
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    for told in stamps.values():
        assert told == sorted(told)
        assert HOUR_S - 60.0 < told[-1] - began_s < HOUR_S + 60.0
    assert (last["latched"], last["fault_code"], last["ring_drops"]) == (False, 0, 0)
