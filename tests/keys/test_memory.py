"""Whose connections are ended when the memory is full, and when that does not help."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hapticd.keys import memory
from hapticd.keys.memory import Culprits, MemoryBound, resident_bytes

BOUND = 100
FURTHER_BYTES = 64 << 20
"""By which the bound rises where it is not clients who have the memory."""


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What is resident, as the test says."""
    held = [0]
    monkeypatch.setattr(memory, "resident_bytes", lambda: held[-1])
    return held


def test_a_process_has_more_than_a_megabyte_and_less_than_the_computer() -> None:
    assert 1 << 20 < resident_bytes() < 1 << 40


WITHOUT_DESCRIPTORS = """
import resource
from hapticd.keys.memory import MemoryBound, resident_bytes
bound = MemoryBound()
resource.setrlimit(resource.RLIMIT_NOFILE, (0, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
print(bound.turn(0.0).name)
"""


def test_a_process_without_a_descriptor_to_spare_knows_what_it_has() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_DESCRIPTORS], capture_output=True, text=True, check=True)
    assert done.stdout == "NO_ONE\n"


def test_a_process_that_another_one_forked_looks_at_its_own_memory() -> None:
    code = (
        "import os; from hapticd.keys.memory import resident_bytes; before = resident_bytes(); child = os.fork()\n"
        "if not child: taken = bytearray(64 << 20); taken[::4096] = bytes([1]) * len(taken[::4096])\n"
        "if not child: os._exit(resident_bytes() - before < 60 << 20)\n"
        "assert os.waitpid(child, 0)[1] == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_within_the_bound_no_connection_is_ended(held: list[int]) -> None:
    bound = MemoryBound(BOUND)
    held.append(BOUND)
    assert {bound.turn(0.1 * look) for look in range(50)} == {Culprits.NO_ONE}


def test_what_the_process_had_before_counts_for_no_client(held: list[int]) -> None:
    """A program that makes a publisher of its own may be large already."""
    held.append(10 * BOUND)
    bound = MemoryBound(BOUND)
    held.append(11 * BOUND)
    assert bound.turn(0.0) is Culprits.NO_ONE
    held.append(11 * BOUND + 1)
    assert bound.turn(1.0) is Culprits.SENDERS


def test_for_a_second_those_that_send_are_ended_then_all_and_then_the_bound_is_further_up(held: list[int]) -> None:
    bound = MemoryBound(BOUND)
    held.append(BOUND + 1)
    asked = [bound.turn(0.25 * look) for look in range(13)]
    assert asked == [Culprits.SENDERS] * 4 + [Culprits.ALL] + [Culprits.NO_ONE] * 8
    held.append(BOUND + 1 + FURTHER_BYTES)
    assert bound.turn(10.0) is Culprits.NO_ONE
    held.append(BOUND + 2 + FURTHER_BYTES)
    assert bound.turn(11.0) is Culprits.SENDERS


def test_what_is_free_is_given_back_before_any_connection_is_ended(
    held: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The C library keeps what ended connections had; that is no reason to end more."""
    given: list[int] = []
    monkeypatch.setattr(memory, "_give_back", lambda: given.append(held.pop()))
    bound = MemoryBound(BOUND)
    held.append(BOUND)
    assert bound.turn(0.0) is Culprits.NO_ONE
    assert given == []
    held.append(BOUND + 1)
    assert bound.turn(1.0) is Culprits.NO_ONE
    assert given == [BOUND + 1]


def test_what_was_freed_is_no_longer_resident_once_it_is_given_back() -> None:
    """In a process of its own: what other tests have freed would count as well, and what they take as less."""
    code = (
        "from hapticd.keys import memory; many = [bytes(100_000) for _ in range(640)]; "
        "before = memory.resident_bytes(); many[:-1] = []; freed = memory.resident_bytes(); "
        "memory._give_back(); print(before - freed, before - memory.resident_bytes())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    freed_bytes, given_bytes = map(int, done.stdout.split())
    assert freed_bytes < 10 << 20, "the C library keeps it: nothing is shown"
    assert given_bytes > 40 << 20


def test_once_it_has_helped_the_next_time_is_as_the_first(held: list[int]) -> None:
    bound = MemoryBound(BOUND)
    for start_s in (0.0, 100.0):
        held.append(BOUND + 1)
        assert [bound.turn(start_s + at_s) for at_s in (0.0, 0.5, 1.5)] == [Culprits.SENDERS] * 2 + [Culprits.ALL]
        assert bound.turn(start_s + 2.4) is Culprits.NO_ONE, "what they held may be free a second later"
        held.append(BOUND)
        assert bound.turn(start_s + 2.45) is Culprits.NO_ONE


def test_what_grows_beyond_the_further_bound_at_once_is_met_as_the_first_time(held: list[int]) -> None:
    bound = MemoryBound(BOUND)
    held.append(BOUND + 1)
    assert [bound.turn(at_s) for at_s in (0.0, 1.0, 2.0)] == [Culprits.SENDERS, Culprits.ALL, Culprits.NO_ONE]
    held.append(BOUND + 2 + FURTHER_BYTES)
    assert [bound.turn(at_s) for at_s in (2.1, 3.0)] == [Culprits.SENDERS, Culprits.ALL]
