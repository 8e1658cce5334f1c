"""What clients drive comes and goes with reloads, and nothing of it stays: in the loop no collector finds circles."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.loading import LoadedConfig, load, parse
from hapticd.supervisor.reload import switch_request
from tests.loop.bench import Bench

BALL = load(Path(__file__).parents[2] / "config" / "ball.toml")
WALL = parse("[[scene.walls]]\nstiffness_n_per_m = 100.0\n", "wall.toml")
TOOL = '[[scene.couplings]]\nname = "tool"\nstiffness_n_per_m = 500.0\nmax_force_n = 3.0\n'
FIELD = '[[scene.forces]]\nname = "field"\nmax_force_n = 3.0\n'
CART = (
    '[[scene.objects]]\nname = "cart"\nshape = "sphere"\nradius_m = 0.01\nposition_m = [0.1, 0.1, 0.1]\n'
    "stiffness_n_per_m = 100.0\nremote = true\n"
)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench(BALL)
    yield bench
    bench.close()


def request(more: str) -> dict[str, Any]:
    return switch_request(BALL, parse(BALL.text + more, "lab.toml"))


def left_behind(round_of_requests: Callable[[], None]) -> int:
    """Objects that only a collector would free, the fewest of three rounds: what is made once is made in the first."""
    found = []
    gc.disable()
    gc.freeze()  # what other tests have left is not looked at
    try:
        for _ in range(3):
            gc.collect()
            round_of_requests()
            found.append(gc.collect())
    finally:
        gc.unfreeze()
        gc.enable()
    return min(found)


@pytest.mark.parametrize("more", [TOOL, FIELD, CART], ids=["a coupling", "a force", "a remote object"])
def test_what_clients_drive_is_gone_once_the_scene_has_it_no_more(bench: Bench, more: str) -> None:
    comes, goes = request(more), request("")
    bench.ticks(1)

    def come_and_go() -> None:
        for each in (comes, goes, goes):  # a port that has let go leaves with the next switch
            assert bench.ask(**each) == ""
            bench.ticks(100)

    assert left_behind(come_and_go) == 0
    assert bench.ask(**comes) == ""
    assert len(bench.tick.ports) == 1


@pytest.mark.parametrize(
    ("start", "more"),
    [(WALL, TOOL), (WALL, FIELD), (BALL, TOOL), (BALL, CART)],
    ids=["a coupling", "a force", "a coupling in space", "a remote object"],
)
def test_nothing_stays_of_a_refused_reload_that_brought_what_clients_drive(
    start: LoadedConfig, more: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its limits, and by a law that cannot start when all else is ready."""
    wanted = switch_request(start, parse(start.text + more, "lab.toml"))
    by_limits = {**wanted, "safety": {"max_force_n": 1e3}}
    by_law = {**wanted, "law": "tdpa", "keep_law": False, "params": {}}
    monkeypatch.setattr(plugins.law("tdpa"), "start", lambda *_: 1 / 0)
    bench = Bench(start)
    bench.ticks(1)

    def refused() -> None:
        assert "max_force_n" in bench.ask(**by_limits)
        assert "cannot start" in bench.ask(**by_law)

    left = left_behind(refused)
    ports = bench.tick.ports
    bench.close()
    assert ports == []
    assert left == 0
