"""What a device's driver costs: its tick beside the simulated device's, in turns, in the same run.

    hapticd bench device --config lab.toml [--ticks 4000] [--quick] [--json]

Both run the daemon's own loop at the configuration's rate, under its law, pressed into one wall, and with a force of at
most `MOST_N`: the arithmetic is that of a wall, and nothing pushes.
"""

from __future__ import annotations

import gc
import os
import signal
from array import array
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import tomlkit

from hapticd.config.file import table_of
from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import HapticdError
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until
from hapticd.measure import Conditions, MachineWatch, Progress, Quantiles, ratio
from hapticd_bench.tick.block import run_loop
from hapticd_bench.tick.case import WARM_TICKS
from hapticd_bench.tick.spawned import Spawned

MOST_N = 1e-3
"""Force limit of both [N]: less than any hand feels."""

ROUNDS = 4
"""Blocks that the ticks are divided into; a device is opened and armed twice in each."""

_PIECES = ("nothing", "read", "step", "write", "record")
_TABLES = ("loop", "velocity", "controller")
_WALL = {"position_m": 10.0, "stiffness_n_per_m": 1.0}
"""Every device is in it, wherever its handle is."""


@dataclass(frozen=True, slots=True)
class DeviceReport:
    """What was measured.

    Attributes:
        driver: of the configuration.
        rate_hz: of the loop [Hz].
        device_us, simulated_us: all between two sleeps of the loop, on the device and on the simulated one [us].
        p50_ratio, p99_ratio: of the device's to the simulated one's.
        of_period: p99 of `device_us` as a share of the period.
        read_us, write_us: the driver's calls, taken in ticks of their own, what timing costs taken off [us].
        disarmed: why the device could not be armed, so that nothing was written; empty when it was.
        realtime: whether it was a real-time process.
        warnings: what it could not have.
        conditions: the machine.
    """

    driver: str
    rate_hz: float
    device_us: Quantiles
    simulated_us: Quantiles
    p50_ratio: float
    p99_ratio: float
    of_period: float
    read_us: Quantiles
    write_us: Quantiles
    disarmed: str
    realtime: bool
    warnings: tuple[str, ...]
    conditions: Conditions


def measure(config: LoadedConfig, ticks: int, progress: Progress) -> DeviceReport:
    """Measure `ticks` ticks of the configuration's device, as many of the simulated one, and as many calls.

    Args:
        config: names the device, with its options, and the law and the rate of the loop.
        ticks: of each.
        progress: told as it goes; `duration_s` says what it adds up to.

    Raises:
        HapticdError: the device cannot be used, or its loop stopped by a fault.
    """
    machine = MachineWatch()
    process = Spawned("the measuring process", _measure_blocks, config.text, str(config.path), ticks)
    try:
        while not isinstance(found := process.receive(), _Found):
            machine.look()
            progress(found)
    finally:
        process.kill()
    device, simulated = _quantiles(found.device), _quantiles(found.simulated)
    timing_us = _quantiles(found.pieces["nothing"]).p50
    return DeviceReport(
        driver=config.config.device.driver,
        rate_hz=config.config.loop.rate_hz,
        device_us=device,
        simulated_us=simulated,
        p50_ratio=ratio(device.p50, simulated.p50),
        p99_ratio=ratio(device.p99, simulated.p99),
        of_period=device.p99 * 1e-6 * config.config.loop.rate_hz,
        read_us=_quantiles(found.pieces["read"], timing_us),
        write_us=_quantiles(found.pieces["write"], timing_us),
        disarmed=found.disarmed,
        realtime=not found.problems,
        warnings=tuple(found.problems + found.advice),
        conditions=machine.end(),
    )


def duration_s(config: LoadedConfig, ticks: int) -> float:
    """What `measure` tells its progress in all [s]."""
    return 3 * ticks / config.config.loop.rate_hz


def without_push(config: LoadedConfig, simulated: bool = False) -> LoadedConfig:
    """The configuration's device, law and rate with one wall, under a force limit of `MOST_N`.

    Args:
        config: the user's own.
        simulated: with the simulated device in the place of the configuration's.
    """
    table = table_of(config.text)
    made: dict[str, Any] = {name: table[name] for name in _TABLES if name in table}
    made["loop"] = {**made.get("loop", {}), "law_budget": 1.0}  # it is measured, not judged
    made["safety"] = {**table.get("safety", {}), "profile": "device", "max_force_n": MOST_N}
    made["safety"].pop("max_axis_force_n", None)
    walls = config.config.scene.walls
    made["scene"] = {"walls": [{**_WALL, "axis": walls[0].axis} if walls else _WALL]}
    if simulated:
        made.pop("velocity", None)
    else:
        made["device"] = table.get("device", {})
    return parse(tomlkit.dumps(made), str(config.path))


@dataclass(slots=True)
class _Found:
    """What the measuring process has found [ns]."""

    device: array[int]
    simulated: array[int]
    pieces: dict[str, list[int]]
    disarmed: str
    problems: list[str]
    advice: list[str]


def _measure_blocks(connection: Connection, text: str, name: str, ticks: int) -> None:
    die_with_parent(os.getppid())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    config = parse(text, name)
    device, simulated = without_push(config), without_push(config, simulated=True)
    found = _Found(array("q"), array("q"), {name: [] for name in _PIECES}, "", [], [])
    try:
        for each in (device, simulated):  # first calls, before memory is locked
            _block(each, 0, {})
        found.problems, found.advice = become_realtime(config.config.loop)
        for block in (ticks * (number + 1) // ROUNDS - ticks * number // ROUNDS for number in range(ROUNDS)):
            pieces: dict[str, list[int]] = {name: [] for name in _PIECES}
            found.simulated.extend(_block(simulated, block, {})[0])
            spent, found.disarmed = _block(device, block, {})
            found.device.extend(spent)
            _block(device, block, pieces)
            for name, times in pieces.items():
                found.pieces[name] += times[WARM_TICKS:]
            gc.collect()
            connection.send(3 * block / config.config.loop.rate_hz)
    except HapticdError as error:
        connection.send(HapticdError(str(error)))
        return
    connection.send(found)


def _block(config: LoadedConfig, ticks: int, pieces: dict[str, list[int]]) -> tuple[array[int], str]:
    """What some ticks took [ns], and why the device stayed disarmed."""
    spent: array[int] = array("q", bytes(8 * (WARM_TICKS + ticks)))
    disarmed = run_loop(config, spent, sleep_until, pieces)
    return spent[WARM_TICKS:], disarmed


def _quantiles(spent_ns: array[int] | list[int], timing_us: float = 0.0) -> Quantiles:
    return Quantiles.of(max(0.0, spent * 1e-3 - timing_us) for spent in spent_ns)
