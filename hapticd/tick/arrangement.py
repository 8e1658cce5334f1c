"""Which contact goes on with which wall when the scene is another."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence

from hapticd.device import DeviceInfo
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.scene import Wall


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
