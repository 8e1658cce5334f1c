"""The couplings and forces of a scene, made ready, and which of them goes on when the scene is another."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TYPE_CHECKING

from hapticd.config.models import SceneConfig
from hapticd.config.ports import PortLimits, port_limits

if TYPE_CHECKING:  # who puts a tick together knows them; what has none in its scene never loads them
    from hapticd.tick.remote.one_port import OnePort, PortAxis


class PortArrangement:
    """The ports of another scene, made ready beside those that are there.

    Attributes:
        ports: in scene order: those that go on under their name, and new ones.
        new: those that are new.
        changed: of those that go on the ones whose limits are others, and those limits.
        gone: those that are not in the scene any more.
        turned: of those that go on the ones whose laws are to see another motion; they begin anew, by a ramp.
    """

    __slots__ = ("changed", "gone", "new", "ports", "turned")

    def __init__(self, there: Sequence[OnePort] = ()) -> None:
        self.ports = list(there)
        self.new: list[OnePort] = []
        self.changed: list[tuple[OnePort, PortLimits]] = []
        self.gone: list[OnePort] = []
        self.turned: list[OnePort] = []

    def take(self) -> None:
        """Have those that are new join, those that go on do so under their new limits, those that are gone fade out."""
        for port in self.new:
            port.join()
        for port, limits in self.changed:
            port.change(limits)
        for port in self.gone:
            port.leave()


def arrange_ports(
    scene: SceneConfig, there: Sequence[OnePort], make: Callable[[PortLimits], OnePort]
) -> Generator[None, None, PortArrangement]:
    """Find the couplings and forces of another scene, a slice at a time: each goes on under its name.

    Args:
        scene: the scene to be.
        there: its ports so far; nothing is done to them.
        make: a port that is new.
    """
    arrangement = PortArrangement()
    known = {(port.kind, port.name): port for port in there}
    for limits in port_limits(scene):
        if limits.kind == "object":
            continue
        port = known.pop((limits.kind, limits.name), None)
        if port is None:
            port = make(limits)
            arrangement.new.append(port)
            yield
        elif port.limits != limits:
            arrangement.changed.append((port, limits))
            if port.limits.driven != limits.driven:
                arrangement.turned.append(port)
        arrangement.ports.append(port)
    arrangement.gone = list(known.values())
    return arrangement


def axes_of(ports: Iterable[OnePort]) -> list[PortAxis]:
    """All their axes."""
    return [axis for port in ports for axis in port.channels]
