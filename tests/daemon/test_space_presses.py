"""Presses in three axes by a running daemon, judged from its telemetry: steady with the default law.

A ball, the edge of a box and a plane with friction at 12, 18 and 20 kN/m, from sixty starts and directions each. The
same presses without a law move on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from hapticd.config.loading import parse
from hapticd.offline.rehearsal import Rehearsal
from tests.daemon.presses import AWAY, PRESS, scene_text
from tests.daemon.running import Daemon, Subscriber
from tests.offline.space_presses import KINDS, STARTS, STIFFNESSES, STILL_M

JUDGED = 500
"""Ticks at the end of a press in which it must be still."""
TOP = Path(__file__).parents[2]


def spans_m(stiffness: float, law: str | None, kinds: Sequence[str], starts: int) -> list[float]:
    """How far apart the device was in the last half second of each press, as the daemon's telemetry has it."""
    presses = starts * len(kinds)
    seen: list[list[list[float]]] = [[] for _ in range(presses)]
    pushed = [False] * presses
    with (
        Daemon(scene_text(stiffness, law, kinds, starts), pythonpath=TOP) as daemon,
        Subscriber(daemon.endpoint, "hapticd/position") as subscriber,
    ):
        for _, fields in subscriber.maps():
            press, tick = divmod(fields["seq"], PRESS + AWAY)
            if press >= presses:
                break
            if PRESS - JUDGED <= tick < PRESS:
                seen[press].append(fields["position_m"])
                pushed[press] = pushed[press] or any(fields["force_n"])
    assert all(pushed), "the daemon has let the force out"  # as it does where its supervisor stalls for 10 s
    assert all(len(one) > 0.9 * JUDGED for one in seen)  # a busy machine may lose some
    return [_farthest_m(one) for one in seen]


def _farthest_m(places: Sequence[Sequence[float]]) -> float:
    """Between any two of them: a box along the device's axes would be longer as the device is mounted another way."""
    return max(itertools.starmap(math.dist, itertools.combinations({tuple(at) for at in places}, 2)), default=0.0)


@pytest.mark.parametrize("law", [None, "none"])
def test_the_default_law_steadies_the_ball_the_edge_and_the_plane(law: str | None) -> None:
    """At 20 kN/m; the same presses without a law move on."""
    spans = spans_m(20e3, law, KINDS, 1)
    assert [span < STILL_M for span in spans] == [law is None] * len(KINDS), spans


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("law", [None, "none"])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_from_sixty_starts_and_directions(
    kind: str, stiffness: float, law: str | None, record_property: Callable[[str, object], None]
) -> None:
    spans = spans_m(stiffness, law, [kind], STARTS)
    least_um, most_um = min(spans) * 1e6, max(spans) * 1e6
    record_property("prints", f"{kind}, {stiffness:.0f} N/m, {law or 'default'}: {least_um:.1f} to {most_um:.1f} um")
    assert [span < STILL_M for span in spans] == [law is None] * STARTS, spans


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("kind", KINDS)
def test_from_sixty_starts_and_directions_offline(
    kind: str, stiffness: float, record_property: Callable[[str, object], None]
) -> None:
    """The same driver and tick without waiting for the clock."""
    rehearsal = Rehearsal(parse(scene_text(stiffness, None, [kind], STARTS), "presses"))
    seen: list[list[list[float]]] = [[] for _ in range(STARTS)]
    pushed = [False] * STARTS
    for ticks in rehearsal.run(STARTS * (PRESS + AWAY)):
        press, tick = divmod(ticks, PRESS + AWAY)
        if PRESS - JUDGED <= tick < PRESS:
            seen[press].append(list(rehearsal.tick.motion.position_m))
            pushed[press] = pushed[press] or any(rehearsal.tick.force_n)
    assert rehearsal.fault is None
    assert all(pushed)
    spans = [_farthest_m(one) for one in seen]
    record_property(
        "prints", f"{kind}, {stiffness:.0f} N/m, offline: {1e6 * min(spans):.1f} to {1e6 * max(spans):.1f} um"
    )
    assert max(spans) < STILL_M, spans
