"""Another scene or another law, made ready beside a tick that goes on, for it to take at once.

Which contact goes on with which wall is found here; couplings and forces find theirs by name.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TYPE_CHECKING

from hapticd.config.models import SceneConfig
from hapticd.device import DeviceInfo
from hapticd.tick import fallback
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.remote.ports import PortArrangement, axes_of
from hapticd.tick.scene import Wall, check_objects, compile_walls

if TYPE_CHECKING:  # the tick hands its own over
    from hapticd.tick.remote.tick_ports import TickPorts


class Switch:
    """What a switch brings to walls, couplings and forces; until it is taken nothing is done to those that are there.

    Args:
        contacts: one a wall, those that are there.
        ports: couplings and forces that are there.

    Attributes:
        walls: which contact goes on with which wall.
        ports: which couplings and forces go on.
        fresh: contacts and axes that begin anew, under laws of their own.
        laws: laws to be started and put on, each with its contact.
        gone: contacts whose wall is not in the scene any more, each with a law that adds nothing to what fades out.
    """

    __slots__ = ("_there", "_there_ports", "fresh", "gone", "laws", "ports", "walls")

    def __init__(self, contacts: list[Contact], ports: TickPorts) -> None:
        self._there = contacts
        self._there_ports = ports
        self.walls = Arrangement(contacts)
        self.ports = PortArrangement(ports.couplings)
        self.fresh: list[Contact] = []
        self.laws: list[tuple[Contact, RunningLaw]] = []
        self.gone: list[tuple[Contact, RunningLaw]] = []

    def to_scene(
        self,
        scene: SceneConfig,
        info: DeviceInfo,
        period_s: float,
        ramp_s: float,
        make_law: Callable[[], RunningLaw],
    ) -> Generator[None, None, None]:
        """Make another scene ready, a slice at a time.

        Args:
            scene: the scene to be.
            info: what the device declares.
            period_s: nominal time between ticks [s].
            ramp_s: duration of every ramp so far [s].
            make_law: a fresh law, for a wall that is new.

        Raises:
            ConfigError: the scene does not fit the device.
        """
        check_objects(scene.objects, info)
        walls = compile_walls(scene.walls, info, period_s)
        yield
        self.walls = yield from arrange(walls, self._there, info, make_law)
        self.ports = yield from self._there_ports.arrange(scene, ramp_s)
        turned = axes_of(self.ports.turned)
        self.laws = [(contact, contact.law) for contact in (*self.walls.new, *axes_of(self.ports.new))]
        self.laws += [(axis, axis.make_law()) for axis in turned]
        self.fresh = [contact for contact, _ in self.laws]
        for contact in [each for each in self._there if each not in self.walls.contacts]:
            self.gone.append((contact, no_law()))
            yield

    def to_law(self, make_law: Callable[[], RunningLaw]) -> Generator[None, None, None]:
        """Make another law ready for every wall that goes on, a slice at a time."""
        for contact in self.walls.contacts:
            if contact not in self.walls.new:
                self.laws.append((contact, make_law()))
                yield


def no_law() -> RunningLaw:
    """A law that adds nothing to a contact: what it holds fades out."""
    return RunningLaw(fallback, fallback.Params(damping_n_s_per_m=0.0))


class Arrangement:
    """The contacts of another scene, made ready beside those that are there.

    Attributes:
        contacts: one a wall, in scene order: those that go on, and new ones that have not been started.
        changed: of those that go on the ones whose wall is another, and that wall.
        new: those that are new.
    """

    __slots__ = ("changed", "contacts", "new")

    def __init__(self, contacts: Iterable[Contact]) -> None:
        self.contacts = list(contacts)
        self.changed: list[tuple[Contact, Wall]] = []
        self.new: list[Contact] = []


def arrange(
    walls: Sequence[Wall], contacts: Sequence[Contact], info: DeviceInfo, make_law: Callable[[], RunningLaw]
) -> Generator[None, None, Arrangement]:
    """Find the contacts of another scene, a slice at a time.

    Args:
        walls: the walls to be.
        contacts: those that are there; nothing is done to them.
        info: what the device declares.
        make_law: a fresh law, for a new contact.
    """
    arrangement = Arrangement(())
    found = heirs(walls, contacts)
    yield
    for wall, heir in zip(walls, found, strict=True):
        contact = heir
        if contact is None:
            contact = Contact(wall, make_law(), info.resolution_m)
            arrangement.new.append(contact)
            yield
        elif contact.wall.keys != wall.keys:
            arrangement.changed.append((contact, wall))
        arrangement.contacts.append(contact)
    return arrangement


def heirs(walls: Sequence[Wall], contacts: Iterable[Contact]) -> list[Contact | None]:
    """For each wall the contact that goes on with it, if any: the very same wall's, else one in the same place."""
    free = list(contacts)
    found: list[Contact | None] = [None] * len(walls)
    for same in (Wall.same_wall, Wall.same_place):
        for index, wall in enumerate(walls):
            if found[index] is not None:
                continue
            for contact in free:
                if same(contact.wall, wall):
                    free.remove(contact)
                    found[index] = contact
                    break
    return found
