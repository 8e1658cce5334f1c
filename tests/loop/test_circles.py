"""What clients drive comes and goes with reloads, and nothing of it stays: in the loop no collector finds circles."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.config.loading import load, parse
from hapticd.supervisor.reload import switch_request
from tests.loop.bench import Bench

BALL = load(Path(__file__).parents[2] / "config" / "ball.toml")
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


@pytest.mark.parametrize("more", [TOOL, FIELD, CART], ids=["a coupling", "a force", "a remote object"])
def test_what_clients_drive_is_gone_once_the_scene_has_it_no_more(bench: Bench, more: str) -> None:
    comes, goes = request(more), request("")
    bench.ticks(1)
    found = []
    gc.disable()
    gc.freeze()  # what other tests have left is not looked at
    try:
        for _ in range(3):  # what is made once is made in the first round
            gc.collect()
            for each in (comes, goes, goes):  # a port that has let go leaves with the next switch
                assert bench.ask(**each) == ""
                bench.ticks(100)
            found.append(gc.collect())
    finally:
        gc.unfreeze()
        gc.enable()
    assert bench.ask(**comes) == ""
    assert len(bench.tick.ports) == 1
    assert min(found) == 0
