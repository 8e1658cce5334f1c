"""The couplings and forces of a tick: those of its scene, those that fade out, and the books of those that are gone."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

from hapticd.config.models import SceneConfig
from hapticd.config.ports import PortLimits, port_limits
from hapticd.errors import ConfigError
from hapticd.tick.remote.ports import PortArrangement, arrange_ports, axes_of
from hapticd.tick.space.books import Totals

if TYPE_CHECKING:  # what a scene without couplings and forces never loads, and what is handed over
    from hapticd.tick.motion import Motion
    from hapticd.tick.remote.one_port import OnePort, PortAxis

MakePort = Callable[[PortLimits, "Motion", float, float], "OnePort"]
"""Makes a coupling or a force: its limits, where the device is, the device's resolution [m], the duration of its ramps
[s]."""


class TickPorts:
    """What clients drive that pulls on the device by itself.

    Args:
        scene: its couplings and forces join at once.
        make: a coupling or a force; None: there is none and there will be none.
        motion: where the device is.
        resolution_m: smallest step of its position [m].
        ramp_s: duration of every ramp [s].

    Attributes:
        couplings: couplings and forces of the scene, in its order.

    Raises:
        ConfigError: the scene has some, and there is to be none.
    """

    __slots__ = ("_leaving", "_make", "_motion", "_past", "_resolution_m", "couplings")

    def __init__(
        self, scene: SceneConfig, make: MakePort | None, motion: Motion, resolution_m: float, ramp_s: float
    ) -> None:
        self._make = make
        self._motion = motion
        self._resolution_m = resolution_m
        self._leaving: list[OnePort] = []
        self._past = Totals()
        self.couplings = [self._port(limits, ramp_s) for limits in port_limits(scene) if limits.kind != "object"]
        for port in self.couplings:
            port.join()

    @property
    def axes(self) -> list[PortAxis]:
        """All axes that the ticks go through: of those that are there, and of those that fade out."""
        return [*axes_of(self.couplings), *axes_of(self._leaving)]

    def arrange(self, scene: SceneConfig, ramp_s: float) -> Generator[None, None, PortArrangement]:
        """Make those of another scene ready, a slice at a time; nothing here has changed yet.

        Args:
            scene: the scene to be.
            ramp_s: duration of every ramp so far [s].

        Raises:
            ConfigError: the scene has some, and there is to be none.
        """
        return arrange_ports(scene, self.couplings, lambda limits: self._port(limits, ramp_s))

    def take(self, arrangement: PortArrangement, ramp_s: float) -> None:
        """Go on with others; of those that were gone before, the ones that have let go leave their books.

        Args:
            arrangement: the others.
            ramp_s: duration of every ramp from now on [s].
        """
        arrangement.take()
        for port in [port for port in self._leaving if port.asleep]:
            self._past.add_moving(port.books)
            self._leaving.remove(port)
            port.part()
        self._leaving += arrangement.gone
        self.couplings = arrangement.ports
        for port in self.couplings:
            port.set_ramp(ramp_s)

    def share_debts(self) -> None:
        """Have the axes of each port know what they owe, for laws that start now."""
        for port in (*self.couplings, *self._leaving):
            port.share_debt()

    def add_totals(self, totals: Totals) -> None:
        """Add the books of all there ever were."""
        totals.add(self._past)
        for port in (*self.couplings, *self._leaving):
            totals.add_moving(port.books)

    def work_j(self) -> float:
        """What the clients of all there ever were have put in [J]."""
        return self._past.moved_j + sum([port.books.moved_j for port in (*self.couplings, *self._leaving)])

    def _port(self, limits: PortLimits, ramp_s: float) -> OnePort:
        if self._make is None:
            raise ConfigError(f'"{limits.name}": this tick has no {limits.kind}s')
        return self._make(limits, self._motion, self._resolution_m, ramp_s)
