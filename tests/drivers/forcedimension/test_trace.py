"""The last calls of the SDK, kept for a report from a machine that cannot be looked at."""

from __future__ import annotations

import pytest

from hapticd.errors import DeviceDisconnectedError
from tests.drivers.forcedimension.bench import Bench


def without_time(line: str) -> str:
    return line.split(" ", 1)[1]


def test_each_call_is_kept_with_what_it_was_given_and_what_it_wrote(bench: Bench) -> None:
    bench.set(position_m=[0.01, 0.02, 0.03], resolution_m=0, serial=1234)
    driver = bench.driver(trace=1000)
    driver.open()
    bench.clear_log()
    before = len(driver.trace.lines())
    driver.enable()
    driver.read()
    driver.write([0.0, 0.0, 1.5])
    lines = driver.trace.lines()
    names = [without_time(line).split()[0].removesuffix("AndOrientationFrame") for line in lines[before:]]
    assert [name for name in names if not name.startswith("dhdErrorGet")] == bench.log()  # which knows no errors
    assert "dhdGetSerialNumber 1234 0 = 0" in map(without_time, lines)
    assert without_time(lines[-1]) == "dhdSetForceAndTorqueAndGripperForce 0.0 0.0 1.5 0.0 0.0 0.0 0.0 0 = 0"
    (position,) = [line for line in lines if " dhdGetPositionAndOrientationFrame " in line]
    assert without_time(position).startswith("dhdGetPositionAndOrientationFrame 0.01 0.02 0.03 [1.0, ")
    times_ns = [int(line.split()[0]) for line in lines]
    assert times_ns == sorted(times_ns)
    driver.close()


def test_it_is_of_bounded_size_and_outlives_a_device_that_is_lost(bench: Bench) -> None:
    driver = bench.driver(trace=7)
    driver.open()
    driver.enable()
    for _ in range(100):
        driver.read()
        driver.write([0.0, 0.0, 0.0])
    bench.set(present=0)
    with pytest.raises(DeviceDisconnectedError):
        driver.read()
    lines = [without_time(line) for line in driver.trace.lines()]
    assert len(lines) == 7
    assert lines[-2:] == ["dhdErrorGetLast = 2", "dhdErrorGetLastStr = b'communication error'"]
    assert lines[-3].endswith("= -1")
    driver.close()
    assert len(driver.trace.lines()) == 7


def test_without_the_option_nothing_is_kept_and_no_call_costs_more(bench: Bench) -> None:
    driver = bench.driver()
    driver.open()
    driver.read()
    assert driver.trace.lines() == []
    assert driver._set_force.__class__.__name__ == "_FuncPtr"  # the SDK's function itself
    driver.close()
