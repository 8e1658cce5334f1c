"""`hapticd study remote`: clients that are late, uneven and lossy, in the daemon's own tick."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.cli import main
from hapticd.offline.outcome import Outcome
from hapticd.offline.rehearsal import Rehearsal
from hapticd.tick.remote.streamed_force import BLEND_S
from hapticd.tick.remote.update import Update
from hapticd_studies.law_spec import parse_laws
from hapticd_studies.remote.clients import FeltWall, Seen, TamedWall, Tool
from hapticd_studies.remote.network import Network, turns
from hapticd_studies.remote.runs import COLUMNS, MAX_FORCE_N, Case, draw, run

NETWORKS = st.builds(
    Network,
    rate_hz=st.floats(30.0, 1000.0),
    delay_s=st.floats(0.0, 0.05),
    jitter_s=st.floats(0.0, 0.02),
    loss=st.floats(0.0, 0.5),
    burst=st.floats(1.0, 5.0),
    pause_at_s=st.floats(0.0, 1.0),
    pause_s=st.floats(0.0, 1.0),
)


def became(case: Case, law: str) -> dict[str, float]:
    return dict(zip(COLUMNS, run(case, parse_laws(law, {})[0]), strict=True))


def settled(case: Case, law: str) -> bool:
    return became(case, law)["outcome"] == Outcome.SETTLED


# -- the network


@given(network=NETWORKS, seed=st.integers(0, 1 << 30))
def test_a_client_sees_no_future_and_unlearns_nothing(network: Network, seed: int) -> None:
    sees_s = 0.0
    for turn in turns(network, 2.0, seed):
        assert sees_s <= turn.sees_s <= max(turn.at_s - network.delay_s, sees_s)
        sees_s = turn.sees_s
        assert turn.heard_s is None or turn.at_s + network.delay_s <= turn.heard_s
        assert not network.pause_at_s <= turn.at_s < network.pause_at_s + network.pause_s


@pytest.mark.parametrize("burst", [1.0, 4.0])
def test_as_many_messages_are_lost_as_was_said_and_in_rows_as_long(burst: float) -> None:
    lost = [turn.heard_s is None for turn in turns(Network(1000.0, loss=0.2, burst=burst), 100.0, 3)]
    rows = sum(now and not before for before, now in pairwise(lost))
    assert sum(lost) / len(lost) == pytest.approx(0.2, rel=0.1)
    assert sum(lost) / rows == pytest.approx(burst, rel=0.15)


def test_jitter_beyond_a_period_makes_messages_overtake_each_other() -> None:
    heard = [turn.heard_s for turn in turns(Network(500.0, jitter_s=0.02), 1.0, 1) if turn.heard_s is not None]
    assert heard != sorted(heard)


# -- the clients


def test_a_tool_comes_to_lie_where_table_and_push_balance() -> None:
    """Pushed with a constant 3 N it ends 3 N / k deep, whatever it weighs and however seldom it steps."""
    tool, update = Tool(0.2, 5000.0, 1000.0), Update()
    for count in range(1, 400):
        tool.step(0.01, Seen(0.0, 3.0 * 0.01 * count), update)
    assert update.position_m[0] == pytest.approx(-3.0 / 5000.0, rel=1e-3)


def test_a_tool_at_rest_is_not_kicked_by_states_that_are_older_or_newer_than_its_steps() -> None:
    """The mean of a constant push is that push, over whatever time it is seen; over the step's own it is not."""
    tool, update = Tool(0.1, 1000.0, 500.0), Update()
    steps = random.Random(3)
    saw = 0
    path_m = []
    for count in range(1, 400):
        sees = max(saw, 10 * count - steps.choice((0, 3, 10)))  # ticks of a millisecond
        tool.step(0.01, Seen(0.0, 3.0 * 1e-3 * sees, 1e-3 * (sees - saw)), update)
        saw = sees
        path_m.append(update.position_m[0])
    assert max(path_m[100:]) - min(path_m[100:]) < 1e-9
    assert path_m[-1] == pytest.approx(-3.0 / 1000.0)


def test_a_tuned_wall_ends_at_a_fifth_and_rises_no_faster_than_it_may() -> None:
    wall, update = TamedWall(1000.0), Update()
    before_n = 0.0
    for _ in range(1000):
        wall.step(0.01, Seen(-4e-3, 0.0), update)
        assert abs(update.force_n[0] - before_n) <= TamedWall.SLEW_N_PER_S * 0.01 + 1e-12
        before_n = update.force_n[0]
    assert before_n == pytest.approx(0.2 * 1000.0 * 4e-3, rel=1e-6)
    FeltWall(1000.0).step(0.01, Seen(-4e-3, 0.0), update)
    assert update.force_n[0] == 4.0


# -- the loop around them


def test_a_wall_from_a_client_is_held_as_far_as_theory_says() -> None:
    """Without a law b / (N T / 2 + L): the hold of a client's period and the way there and back."""
    network = Network(200.0, delay_s=0.005)
    b_n_s_per_m = 4.4 + 1.0
    limit_n_per_m = b_n_s_per_m / (0.5 * 0.005 + 0.010 + 0.5e-3)
    assert settled(Case("below", "force", 0.7 * limit_n_per_m, network), "none")
    above = became(Case("above", "force", 1.5 * limit_n_per_m, network), "none")
    assert above["outcome"] == Outcome.MOVING
    assert above["span_m"] > 1e-3


@pytest.mark.parametrize(("kind", "stiffness_n_per_m"), [("tool", 2263.0), ("force", 3200.0)])
def test_the_law_of_a_port_holds_what_no_law_does(kind: str, stiffness_n_per_m: float) -> None:
    """At 60 Hz and 10 ms each way such a spring swings by centimetres; with the law it rests in its place."""
    case = Case("late", kind, stiffness_n_per_m, Network(60.0, delay_s=0.01))
    assert became(case, "none")["span_m"] > 0.01
    rested = became(case, "late-cycle")
    assert rested["outcome"] == Outcome.SETTLED
    assert rested["peak_force_n"] <= 12.0


def test_a_client_that_pauses_is_let_go_and_comes_back_to_its_place() -> None:
    network = Network(200.0, delay_s=0.005, pause_at_s=1.5, pause_s=0.6)
    rested = became(Case("paused", "force", 400.0, network), "late-cycle")
    assert rested["outcome"] == Outcome.SETTLED


@pytest.mark.parametrize(("kind", "index"), [("tool", 263), ("tool", 371), ("force", 11)])
def test_a_client_that_pauses_never_pushes_beyond_its_limit_and_comes_in_by_the_ramp(kind: str, index: int) -> None:
    """Whatever has become of the device since: the client's part of the force goes no faster than ramp and motion."""
    case = draw(4, index, kind)
    pause = case.network
    assert pause.pause_s > 0.3
    own_n, ways_m, pauses = [0.0], [0.0], list[float]()

    def take(rehearsal: Rehearsal) -> None:
        port = rehearsal.tick.couplings[0]
        assert abs(rehearsal.tick.force_n[0]) <= MAX_FORCE_N
        own_n.append(port.channels[0].own_n)
        ways_m.append(abs(rehearsal.tick.motion.velocity_m_per_s[0]) * 1e-3)
        pauses.append(port.weight)

    run(case, parse_laws("late-cycle", {})[0], take)
    assert 0.0 in pauses[round(1e3 * pause.pause_at_s) :]
    followed_m = 1e-3 if kind == "tool" else 0.0  # a target's fastest way
    for before, now, way_m, last_m in zip(own_n, own_n[1:], ways_m[1:], ways_m, strict=False):
        ramp_n = 2.0 * MAX_FORCE_N * 1e-3 / 0.05
        if kind == "tool":  # its spring, and its damper of 2 N s/m
            most_n = ramp_n + case.stiffness_n_per_m * (way_m + followed_m) + 2.0 * (way_m + last_m + 0.4e-3) / 1e-3
        else:
            most_n = ramp_n + MAX_FORCE_N * 1e-3 / BLEND_S
        assert abs(now - before) <= most_n * (1.0 + 1e-9)


def test_a_random_client_is_the_same_anywhere_and_none_is_like_another() -> None:
    assert draw(7, 3, "tool") == draw(7, 3, "tool")
    assert len({draw(7, index, kind) for index in range(50) for kind in ("tool", "force")}) == 100


# -- the command


def remote(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "remote", *arguments])
    return int(left.value.code or 0)


def test_the_command_writes_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert remote("--clients", "1", "--quick", "--laws", "damper:damping_n_s_per_m=1", "--output", str(tmp_path)) == 0
    found = json.loads((tmp_path / "remote.json").read_text())
    assert {one["kind"] for one in found["random"]} == {"tool", "force"}
    assert all(one["largest_force_n"] <= 12.0 for one in found["random"])
    lines = (tmp_path / "remote.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * (1 + 5)
    assert (tmp_path / "remote.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "remote.journal").exists()
    assert "Random clients" in capsys.readouterr().out


def test_one_client_again_says_what_it_is_and_what_becomes_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert remote("--replay", "force:1:0", "--laws", "none", "--come-in-s", "0.5") == 0
    said = capsys.readouterr().out
    case = draw(1, 0, "force")
    assert f"rate_hz = {case.network.rate_hz}" in said
    assert "come_in_s = 0.5" in said
    assert "none" in said
    assert "damper:100" in said


@pytest.mark.parametrize("hand", ["stroke", "tap"])
def test_a_hand_that_moves_feels_a_damper_as_drag_and_comes_to_rest(hand: str) -> None:
    case = replace(draw(7, 0, "tool", hand), network=Network(500.0), stiffness_n_per_m=500.0)
    dragged = became(case, "damper:damping_n_s_per_m=20")
    assert dragged["drag_n_s_per_m"] == pytest.approx(20.0)
    assert dragged["outcome"] == Outcome.SETTLED
    assert became(case, "none")["drag_n_s_per_m"] == 0.0


@pytest.mark.parametrize(
    "arguments",
    [("--clients", "0"), ("--hand", "slap"), ("--replay", "wall:1:2"), ("--laws", "no-such"), ("--come-in-s", "11")],
)
def test_what_makes_no_sense_is_one_line(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert remote(*arguments) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
