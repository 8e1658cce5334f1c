"""Other objects or another law, made ready beside a tick that goes on, for it to take at once.

An object goes on under its name: with its laws and its books, whatever about it is another.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import TYPE_CHECKING

from hapticd.config.objects import ObjectConfig
from hapticd.shapes.solid import Proxy
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.space.solid import Solid, compile_objects
from hapticd.tick.switch import no_law

if TYPE_CHECKING:  # the tick hands its own over
    from hapticd.tick.space.channel import Channel
    from hapticd.tick.space.solid_contact import SolidContact


class SpaceSwitch:
    """What a switch brings to objects; until it is taken nothing is done to those that are there.

    Args:
        solids: one a solid, those that are there.

    Attributes:
        solids: one a solid, in scene order: those that go on, and new ones that have not been started.
        new: those that are new.
        changed: of those that go on the ones whose solid is another, that solid, and channels that it needs beside.
        kept: of those that go on the others, and the solid whose place in the scene they take over.
        fresh: channels that begin anew, under laws of their own.
        laws: laws to be started and put on, each with its channel.
        gone: those that are not in the scene any more, and for each channel a law that adds nothing to what fades out.
    """

    __slots__ = ("changed", "fresh", "gone", "kept", "laws", "new", "solids")

    def __init__(self, solids: list[SolidContact]) -> None:
        self.solids = solids
        self.new: list[SolidContact] = []
        self.changed: list[tuple[SolidContact, Solid, list[Channel]]] = []
        self.kept: list[tuple[SolidContact, Solid]] = []
        self.fresh: list[Channel] = []
        self.laws: list[tuple[Contact, RunningLaw]] = []
        self.gone: list[tuple[SolidContact, list[tuple[Contact, RunningLaw]]]] = []

    def to_scene(
        self,
        objects: Sequence[ObjectConfig],
        period_s: float,
        make_contact: Callable[[Solid], SolidContact],
        make_law: Callable[[], RunningLaw],
    ) -> Generator[None, None, None]:
        """Make other objects ready, a slice at a time.

        Args:
            objects: of the scene to be.
            period_s: nominal time between ticks [s].
            make_contact: makes the contact of a solid that is new.
            make_law: a fresh law, for a channel that one that goes on needs beside.

        Raises:
            ConfigError: an object does not fit.
        """
        solids = yield from compile_objects(objects, period_s)
        known = {(contact.solid.name, contact.moves): contact for contact in self.solids}
        self.solids = []
        for solid in solids:
            contact = known.pop((solid.name, solid.remote), None)
            if contact is None:
                contact = make_contact(solid)
                self.new.append(contact)
            elif not solid.same_as(contact.solid):
                self.changed.append((contact, solid, contact.rougher(solid, make_law)))
            else:
                self.kept.append((contact, solid))
            self.solids.append(contact)
            yield
        self.fresh = [channel for contact in self.new for channel in contact.channels]
        self.fresh += [channel for _, _, channels in self.changed for channel in channels]
        self.laws = [(channel, channel.law) for channel in self.fresh]
        for contact in known.values():
            self.gone.append((contact, [(channel, no_law()) for channel in contact.channels]))

    def to_law(self, make_law: Callable[[], RunningLaw]) -> Generator[None, None, None]:
        """Make another law ready for every object that goes on, a slice at a time."""
        for contact in self.solids:
            if contact not in self.new:
                self.laws += [(channel, make_law()) for channel in contact.channels]
                yield


def holding(contacts: Iterable[SolidContact], comes: Solid) -> list[Proxy]:
    """What holds the device where a solid comes: what has an object of that one's first, then what pushes most."""
    names = {config.name for config in comes.configs}

    def later(contact: SolidContact) -> tuple[bool, float]:
        pushes_n2 = sum(newton * newton for newton in contact.force)
        return names.isdisjoint(config.name for config in contact.solid.configs), -pushes_n2

    touched = [contact for contact in contacts if contact.solid.proxy.touching]
    return [contact.solid.proxy for contact in sorted(touched, key=later)]
