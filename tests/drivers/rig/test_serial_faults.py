"""A line that spoils what is on it, 1 % to 50 % of its frames, both ways.

Whatever comes, nothing but the driver's own errors is raised, only intact messages are believed, and once the line is
clean again the rig answers within `RECOVERY_TICKS`.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.link import Link
from hapticd_drivers.rig.messages import State
from hapticd_drivers.rig.metrics import METRICS
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from tests.drivers.rig.device import Rig
from tests.examples import examples

TICKS = 1500
RECOVERY_TICKS = 3
"""At most the damaged frame and the one that it has run into are lost, and one tick passes until the next answer."""

PERIOD_S = 0.001


class Noise:
    """Spoils a share of the frames on a line, each in a way that is drawn for it.

    Args:
        seed: of the random numbers.
        share: of the frames that are spoilt.
        kinds: ways to spoil them.
    """

    def __init__(self, seed: int, share: float, kinds: tuple[str, ...]) -> None:
        self.share = share
        self.spoilt = 0
        self._random = random.Random(seed)
        self._kinds = kinds
        self._held: list[tuple[int, bytes]] = []

    def __call__(self, data: bytes) -> bytes:
        out = b""
        for frame in re.findall(rb"[^\0]*\0|[^\0]+$", data):
            if self._random.random() < self.share:
                self.spoilt += 1
                out += getattr(self, f"_{self._random.choice(self._kinds)}")(frame)
            else:
                out += frame
            out += self._released()
        return out

    def _released(self) -> bytes:
        due = b"".join(frame for turns, frame in self._held if turns <= 0)
        self._held = [(turns - 1, frame) for turns, frame in self._held if turns > 0]
        return due

    def _bytes(self, frame: bytes) -> bytes:
        return self._random.randbytes(self._random.randint(1, 100)) + frame

    def _flips(self, frame: bytes) -> bytes:
        flipped = bytearray(frame)
        for _ in range(self._random.randint(1, 8)):
            flipped[self._random.randrange(len(flipped))] ^= 1 << self._random.randrange(8)
        return bytes(flipped)

    def _truncation(self, frame: bytes) -> bytes:
        return frame[: self._random.randrange(len(frame))]

    def _duplication(self, frame: bytes) -> bytes:
        return frame * self._random.randint(2, 4)

    def _reordering(self, frame: bytes) -> bytes:
        self._held.append((1, frame))
        return b""

    def _delay(self, frame: bytes) -> bytes:
        self._held.append((self._random.randint(2, 10), frame))
        return b""


KINDS = ("bytes", "flips", "truncation", "duplication", "reordering", "delay")


def crc_of(data: bytes) -> int:
    """CRC-16/IBM-3740 bit by bit, for the library's to be checked against."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class Watched(SerialRig):
    """Remembers the counts of every state that came intact."""

    def _connect(self) -> Link:
        link = super()._connect()
        receive = link.receive
        self.states: list[State] = []

        def watched() -> list[bytes]:
            came = receive()
            for message in came:
                assert crc_of(message[:-2]) == int.from_bytes(message[-2:], "little")
                said = messages.decode(message)
                if isinstance(said, State):
                    self.states.append(said)
            return came

        link.receive = watched  # type: ignore[method-assign]  # only looks on
        return link

    def believed(self) -> set[float]:
        """Positions that one of the last intact states has told."""
        return {self._maps[0].position_m(state.position[0]) for state in self.states[-20:]}


def opened(rig: Rig) -> Watched:
    rig.set_home()
    driver = Watched(SerialRigOptions(port=str(rig.port), sign_checked=True), PERIOD_S)
    driver.open()
    driver.enable()
    return driver


def tick(rig: Rig, driver: Watched) -> tuple[float, int]:
    """One tick against a spring; position and count of the sample. The rig has heard it, and its answer waits."""
    sample = driver.read()
    position_m = sample.position_m[0]
    driver.write([max(-2.0, min(2.0, -500.0 * position_m))])
    rig.wait_for(driver)
    return position_m, sample.sequence


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("kinds", [*((kind,) for kind in KINDS), KINDS], ids=[*KINDS, "all"])
def test_a_noisy_line_costs_frames_and_nothing_else(
    rig: Rig, kinds: tuple[str, ...], share: float, record_property: Callable[[str, object], None]
) -> None:
    driver = opened(rig)
    rig.plant.hand_n = 0.2  # so that it moves, and a stale position is not the same by chance
    rig.down, rig.up = Noise(1, share, kinds), Noise(2, share, kinds)
    last = -1
    blind = [0]
    for _ in range(TICKS):
        position_m, sequence = tick(rig, driver)
        assert position_m in driver.believed()
        assert sequence >= last
        blind = [*blind, 0] if sequence > last else [*blind[:-1], blind[-1] + 1]
        last = sequence
    spoilt = rig.down.spoilt, rig.up.spoilt
    assert min(spoilt) > 0.5 * share * TICKS * 0.5

    rig.down = rig.up = bytes
    ticks = 0
    while tick(rig, driver)[1] <= last:
        ticks += 1
        assert ticks <= RECOVERY_TICKS
    record_property("frames_spoilt", sum(spoilt))
    record_property("ticks_blind_share", sum(blind) / TICKS)
    record_property("ticks_blind_longest", max(blind))
    record_property("ticks_to_recover", ticks)
    for place, metric in enumerate(METRICS):
        if metric.warns:
            record_property(metric.name, driver.metrics[place])
    driver.close()


@examples(60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(garbage=st.lists(st.binary(min_size=1, max_size=300), min_size=1, max_size=5))
def test_whatever_bytes_come_the_next_ticks_answer_is_found(rig: Rig, garbage: list[bytes]) -> None:
    """Bytes that nobody meant, in front of each answer."""
    driver = opened(rig)
    tick(rig, driver)
    waiting = list(garbage)
    rig.up = lambda data: waiting.pop() + data if data and waiting else data
    for _ in range(len(garbage) + 2):
        tick(rig, driver)
    before = driver.read().sequence
    for _ in range(RECOVERY_TICKS):
        after = tick(rig, driver)[1]
    assert after > before
    rig.up = bytes
    driver.close()
