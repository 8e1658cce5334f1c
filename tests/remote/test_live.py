"""Random clients of the study in real time: what the daemon did is what the tick does, within limits, and it rests.

A busy computer makes a client later than its network is, and so another client each time, of which the law holds most
and not all. So what has not come to rest is run again offline with every message as late as it was. Where something
would have held it then, and the study's own run of it rests, it is driven again: of three such sessions one must rest.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hapticd.config.loading import LoadedConfig
from hapticd.offline.outcome import Outcome
from hapticd_studies.law_spec import parse_laws
from hapticd_studies.remote.runs import Case, draw, run
from tests.daemon.running import Daemon
from tests.remote.live_client import DAMPERS, MOST_N, Session, again, drive, pressed, under

SEED = 4
CLIENTS = 50
SESSIONS = 3
DAILY = {("tool", 1), ("force", 11)}
"""Both lose messages, in rows too, and pause."""


@pytest.mark.parametrize(
    ("kind", "index"),
    [
        pytest.param(kind, index, marks=[] if (kind, index) in DAILY else [pytest.mark.nightly])
        for index in range(CLIENTS // 2)
        for kind in ("tool", "force")
    ],
)
def test_a_random_client_is_held_within_limits_without_a_step_and_comes_to_rest(
    kind: str, index: int, record_property: Callable[[str, object], None]
) -> None:
    """`--junit-xml` has of each client what the law made of it, and what two dampers would have made of the same."""
    case, config = pressed(SEED, index, kind, at_s=1.0)
    ticks = 4000 if (kind, index) in DAILY else 5500
    record_property("client", f"{kind}:{SEED}:{index}")
    for number in range(SESSIONS):
        session = driven(case, config, ticks)
        dampers = under(session, DAMPERS)
        record_property(f"law {number}", f"{session.outcome}, moves by {1e3 * session.span_m:.3f} mm")
        record_property(f"dampers {number}", ", ".join(map(str, dampers)))
        if session.outcome is Outcome.SETTLED or Outcome.SETTLED not in dampers:
            return
        if number == 0:
            studied = run(draw(SEED, index, kind), parse_laws(config.config.remote.law, {})[0])
            if studied[0] != Outcome.SETTLED:
                return
    raise AssertionError(f"in none of {SESSIONS} sessions did it rest, and a damper would have held each of them")


def driven(case: Case, config: LoadedConfig, ticks: int) -> Session:
    """A session, after which the daemon has done what it must whether it rests or not."""
    with Daemon(config.text).wait_ready() as daemon:
        session = drive(daemon, case, config, ticks)
    assert len(session.ticks) > 0.5 * (session.ticks[-1].seq - session.ticks[0].seq)
    assert max(abs(tick.device_n) for tick in session.ticks) <= MOST_N * (1.0 + 1e-9)
    assert session.unramped() == []
    positions_m = again(session)
    assert all(tick.x_m == positions_m[tick.seq] for tick in session.ticks), "to the last bit"
    return session
