"""A configuration on its simulated device, as fast as it goes: the daemon's tick without clock, process or telemetry.

The numbers are the daemon's to the last bit, tick by tick, since the parts are the same and the simulated device
advances by one period a tick whatever the host does.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.errors import ConfigError, DriverError
from hapticd.offline.outcome import Criterion, balance
from hapticd.offline.run import Row, Run, window_ticks
from hapticd.offline.space_row import SpaceRow, length, three
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.driver import SimulatedDriver
from hapticd.simulation.options import FARTHEST_M, SimulationOptions
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.contact import Contact
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.guard import Mode
from hapticd.tick.space.solid_contact import SolidContact
from hapticd.tick.space.tick import SpaceTick
from hapticd.tick.tick import ControlTick

LONGEST_S = 1e9
"""The longest run [s]."""

_CHUNK_TICKS = 2000
"""Ticks that are collected at once; progress hears as often."""

_CODES = {"cycle": "q", "in_contact": "b", "armed": "b", "touched": "q"}
"""Type codes of the columns that hold no floats."""

MakeRows = Callable[["Rehearsal", int, int], Iterator["Row | SpaceRow"]]

MakeDevice = Callable[[SimulationOptions, float], SimulatedDevice]
"""Makes the model of a device, given its options and the period [s]."""


class Rehearsal:
    """One run of a configuration offline.

    Args:
        loaded: the configuration.
        options: of its device; None: the configuration's own.
        make_device: makes the device model.

    Attributes:
        model: the simulated device, along its first axis.
        space: the same in several axes; None where it has one.
        tick: the daemon's tick on it.
        fault: why the daemon would have stopped, once it is known; None as long as it would not.
        diverged: whether the model left all bounds.

    Raises:
        ConfigError: the configuration is not one for a simulated device.
    """

    def __init__(
        self,
        loaded: LoadedConfig,
        options: SimulationOptions | None = None,
        make_device: MakeDevice | None = None,
    ) -> None:
        wanted = simulation_options(loaded) if options is None else options
        loaded = replace(loaded, options=wanted)
        self.period_s = loaded.config.loop.period_s
        self.fault: str | None = None
        self.diverged = False
        driver = loaded.make_driver()
        assert isinstance(driver, SimulatedDriver)
        if make_device is not None:
            driver.make_model = make_device
        self._driver = driver
        place_device(loaded, self._driver)
        self._driver.open()
        try:
            self.space = self._driver.space
            self.model = self._driver.model if self.space is None else self.space.axes[0]
            self.tick = make_tick(loaded, self._driver.info)
        except BaseException:
            self._driver.close()
            raise

    def run(self, ticks: int) -> Generator[int, None, None]:
        """Run, and stop after each tick; its number is given. Ends early when the model has diverged."""
        driver, tick = self._driver, self.tick
        guard = tick.guard
        try:
            tick.start(driver.read())
            driver.enable()
            tick.arm()
            for count in range(ticks):
                sample = driver.read()
                force_n = tick.advance(sample, self.period_s)
                if guard.mode is not Mode.DISARMED:
                    driver.write(force_n)
                else:
                    driver.disable()
                if tick.fault:
                    self.fault = self.fault or f"{count * self.period_s:g} s: {tick.fault_text}"
                    tick.fault = 0
                yield count
        except DriverError as error:
            self.fault = self.fault or str(error)
            at_m = [self.model.measured_m] if self.space is None else self.space.measured_m
            self.diverged = not all(abs(x_m) < FARTHEST_M for x_m in at_m)
        finally:
            driver.close()

    def hold(self) -> None:
        """Have the device hold the force of a tick that was made elsewhere: `run` goes on from there."""
        self._driver.write(self.tick.force_n)


def simulation_options(loaded: LoadedConfig) -> SimulationOptions:
    """The device model of a configuration that can run offline.

    Raises:
        ConfigError: it is not one for a simulated device, or not for one that counts ticks.
    """
    if not (isinstance(loaded.options, SimulationOptions) and issubclass(loaded.driver, SimulatedDriver)):
        raise ConfigError(
            f'{loaded.path}: device.driver = "{loaded.config.device.driver}": only a simulated device runs offline, '
            'such as "loopback"'
        )
    if loaded.options.clock != "ticks":
        raise ConfigError(f'{loaded.path}: device.options.clock = "{loaded.options.clock}": must be "ticks" offline')
    return loaded.options


def columns_of(loaded: LoadedConfig) -> tuple[str, ...]:
    """Names of the columns that a run of a configuration has.

    Raises:
        ConfigError: it is not one for a simulated device.
    """
    return Row._fields if simulation_options(loaded).axes == 1 else SpaceRow._fields


def ticks_in(loaded: LoadedConfig, duration_s: float) -> int:
    """How many ticks a time takes.

    Raises:
        ConfigError: the time makes no sense.
    """
    period_s = loaded.config.loop.period_s
    if not period_s <= duration_s <= LONGEST_S:
        raise ConfigError(
            f"duration = {duration_s:g} s: must be at least one period, {period_s:g} s, and at most {LONGEST_S:g} s"
        )
    return round(duration_s / period_s)


def rehearse(
    loaded: LoadedConfig,
    duration_s: float,
    options: SimulationOptions | None = None,
    make_device: MakeDevice | None = None,
    take: Callable[[Any], object] | None = None,
    progress: Callable[[int], object] | None = None,
) -> Run:
    """Run a configuration from the first tick to the last, or to where the model has diverged.

    Args:
        loaded: the configuration.
        duration_s: simulated time [s].
        options: of its device; None: the configuration's own.
        make_device: makes the device model; None: the usual one.
        take: is given every row as it comes; the run then keeps the last half second only.
        progress: hears now and then how many ticks are done.

    Raises:
        ConfigError: the duration makes no sense, or the configuration is not one for a simulated device.
        DriverError: the device cannot be stepped at this rate, or gave not even one sample.
    """
    ticks = ticks_in(loaded, duration_s)
    rehearsal = Rehearsal(loaded, options, make_device)
    space = rehearsal.space
    device = rehearsal.model.options if space is None else space.options
    at = balance(device, loaded.config.scene.walls)
    keep = None if take is None else window_ticks(rehearsal.period_s)
    collected = _Collected(at.x_m, Criterion().place_limit_m(device, at), keep, columns_of(loaded))
    chunk: list[Row | SpaceRow] = []
    make_rows: MakeRows = _rows if space is None else _rows_in_space
    for row in make_rows(rehearsal, ticks, loaded.config.loop.period_ns):
        chunk.append(row)
        if take is not None:
            take(row)
        if len(chunk) == _CHUNK_TICKS:
            collected.add(chunk)
            chunk.clear()
            if progress is not None:
                progress(collected.ticks)
    collected.add(chunk)
    if not collected.ticks:
        raise DriverError(rehearsal.fault or "the device gave no sample")
    contacts = rehearsal.tick.contacts
    return Run(
        name=str(loaded.path),
        config=loaded.config,
        options=device,
        columns=collected.columns,
        ticks=collected.ticks,
        left_place_tick=collected.left_place_tick,
        peak_force_n=collected.peak_n,
        stiffness_n_per_m=contacts[0].wall.stiffness_n_per_m if contacts else _stiffness_n_per_m(rehearsal.tick),
        generated_j=sum([ledger.generated_j for ledger in _ledgers(rehearsal.tick)]),
        dissipated_j=sum([ledger.dissipated_j for ledger in _ledgers(rehearsal.tick)]),
        fault=rehearsal.fault,
        diverged=rehearsal.diverged,
    )


def _rows(rehearsal: Rehearsal, ticks: int, period_ns: int) -> Iterator[Row]:
    tick, model = rehearsal.tick, rehearsal.model
    first = tick.contacts[0] if tick.contacts else None
    axis = first.wall.axis if first else 0
    outward = first.wall.outward if first else 1.0
    ledgers = [contact.ledger for contact in tick.contacts]
    for count in rehearsal.run(ticks):
        yield Row(
            count * period_ns / 1e9,
            model.x_m,
            model.v_m_per_s,
            first.x_m if first else tick.motion.position_m[0],
            outward * tick.force_n[axis],
            outward * tick.requested_n[axis],
            sum([ledger.energy_j for ledger in ledgers]),
            first.ledger.cycle if first else 0,
            first.damping_n_s_per_m if first else 0.0,
            int(first.in_contact) if first else 0,
            int(tick.guard.mode is Mode.ARMED),
        )


def _rows_in_space(rehearsal: Rehearsal, ticks: int, period_ns: int) -> Iterator[SpaceRow]:
    tick, device = rehearsal.tick, rehearsal.space
    assert device is not None
    first = tick.contacts[0] if tick.contacts else None
    for count in rehearsal.run(ticks):
        position, velocity = three(device.position_m), three(device.velocity_m_per_s)
        measured, force = three(tick.motion.position_m), three(tick.force_n)
        deepest = max(_touched(tick), key=lambda contact: contact.depth_m, default=None)
        if first is not None:
            wall = first.wall
            x_m = wall.outward * (position[wall.axis] - wall.position_m)
            along = (x_m, wall.outward * velocity[wall.axis], first.x_m)
            forces = (wall.outward * tick.force_n[wall.axis], wall.outward * tick.requested_n[wall.axis])
            shown: Contact | None = first
        elif deepest is not None:
            normal = deepest.normal
            v_m_per_s = normal.dx * velocity[0] + normal.dy * velocity[1] + normal.dz * velocity[2]
            along = (-deepest.depth_m, v_m_per_s, -deepest.depth_m)
            forces = (length(tick.force_n), length(tick.requested_n))
            shown = normal
        else:
            along, forces, shown = (0.0, 0.0, 0.0), (length(tick.force_n), length(tick.requested_n)), None
        yield SpaceRow(
            count * period_ns / 1e9,
            *along,
            *forces,
            sum([ledger.energy_j for ledger in _ledgers(tick)]),
            shown.ledger.cycle if shown else 0,
            shown.damping_n_s_per_m if shown else 0.0,
            int(shown.in_contact) if shown else 0,
            int(tick.guard.mode is Mode.ARMED),
            *position,
            *velocity,
            *measured,
            *force,
            deepest.solid.index if deepest else -1,
            deepest.depth_m if deepest else 0.0,
        )


def _touched(tick: ControlTick) -> list[SolidContact]:
    if not isinstance(tick, SpaceTick):
        return []
    return [contact for contact in tick.solids if contact.in_contact]


def _stiffness_n_per_m(tick: ControlTick) -> float:
    """Of the first object; NaN without one [N/m]."""
    solids = tick.solids if isinstance(tick, SpaceTick) else []
    return solids[0].solid.stiffness_n_per_m if solids else math.nan


def _ledgers(tick: ControlTick) -> list[EnergyLedger]:
    """The books of all walls and objects."""
    solids = [contact.ledger for contact in tick.solids] if isinstance(tick, SpaceTick) else []
    return [contact.ledger for contact in tick.contacts] + solids


class _Collected:
    """Rows as columns, and what must be known of those that are not kept."""

    def __init__(self, rest_m: float, band_m: float, keep: int | None, names: Sequence[str]) -> None:
        self.columns: dict[str, array[Any]] = {name: array(_CODES.get(name, "d")) for name in names}
        self.ticks = 0
        self.left_place_tick = -1
        self.peak_n = 0.0
        self._rest_m = rest_m
        self._band_m = band_m
        self._keep = keep

    def add(self, rows: Sequence[Row | SpaceRow]) -> None:
        """Take rows in."""
        for column, values in zip(self.columns.values(), zip(*rows, strict=True), strict=False):
            column.extend(values)
            if self._keep is not None:
                del column[: -self._keep]
        self.peak_n = max([self.peak_n, *(abs(row.force_n) for row in rows)])
        for at in reversed(range(len(rows))):
            if not abs(rows[at].x_m - self._rest_m) <= self._band_m:  # also where there is no place to rest
                self.left_place_tick = self.ticks + at
                break
        self.ticks += len(rows)
