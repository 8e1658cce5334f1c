"""Every completed cycle is told once and none is made up, whatever reloads do to walls and the ring to records."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

from hypothesis import given
from hypothesis import strategies as st

from hapticd.telemetry.wire import Cycles
from hapticd.tick.contact_record import WallRecord
from tests.telemetry.sockets import ticks

LAGGING = [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)]
"""Cycles of two walls."""

_energies_j = itertools.count(1.0, 0.5)


@dataclass(eq=False)
class Contact:
    """A wall as the loop has it: it keeps its books wherever it stands in the scene."""

    cycle: int = 0
    energy_j: float = 0.0
    told: int = field(default=0, compare=False)

    def complete(self) -> None:
        self.cycle += 1
        self.energy_j = next(_energies_j)


def completed(cycles: Cycles, *contacts: Contact) -> list[tuple[int, int]]:
    record = ticks(1)[0]
    record.walls = tuple(WallRecord(True, 0.0, 0.0, 0.0, one.cycle, one.energy_j, 0.0, 5.0, 0.1) for one in contacts)
    return list(cycles.completed(record))


def test_a_wall_that_takes_the_place_of_a_removed_one_has_completed_nothing() -> None:
    cycles = Cycles()
    first, second = Contact(5, 0.1), Contact(3, 0.2)
    completed(cycles, first, second)
    assert completed(cycles, second) == []
    second.complete()
    assert completed(cycles, second) == [(0, 4)]


def test_a_cycle_that_ends_in_the_tick_of_the_reload_is_told_at_its_walls_new_place() -> None:
    cycles = Cycles()
    first, second = Contact(4, 0.1), Contact(3, 0.2)
    completed(cycles, first, second)
    second.complete()
    assert completed(cycles, second) == [(0, 4)]


def test_of_two_walls_that_are_alike_each_has_its_own_cycles() -> None:
    cycles = Cycles()
    told = [completed(cycles, Contact(first, 0.5 * first), Contact(second, 0.5 * second)) for first, second in LAGGING]
    assert told == [[], [(0, 1)], [(1, 1)], [(0, 2)], [(1, 2)]]


def test_a_cycle_whose_figures_are_no_numbers_is_told_once() -> None:
    cycles = Cycles()
    assert [completed(cycles, Contact(1, math.nan)) for _ in range(3)] == [[(0, 1)], [], []]


@given(st.data())
def test_every_cycle_is_told_once_and_none_is_made_up(data: st.DataObject) -> None:
    """Walls come, go and change places, and of the records between two that are read some are lost."""
    cycles = Cycles()
    contacts: list[Contact] = []
    for _ in range(data.draw(st.integers(1, 12))):
        for _ in range(data.draw(st.integers(1, 3))):  # ticks, of which the last is read
            if data.draw(st.booleans()):
                kept = [one for one in contacts if data.draw(st.integers(0, 3))]
                contacts = data.draw(
                    st.permutations([*kept, *(Contact() for _ in range(data.draw(st.integers(0, 2))))])
                )
            for one in contacts:
                if data.draw(st.booleans()):
                    one.complete()
        expected = [(index, one.cycle) for index, one in enumerate(contacts) if one.cycle != one.told]
        assert completed(cycles, *contacts) == expected
        for one in contacts:
            one.told = one.cycle
