"""What a coupling costs a tick where no client drives it, in counted instructions of the interpreter."""

from __future__ import annotations

from functools import partial

import pytest

from hapticd.offline.operations import count_operations, operations_by_code
from tests.tick.remote.rig import COUPLING, PERIOD_S, WALL, Rig, update
from tests.tick.remote.test_coupling import RAMP_TICKS, held_at


@pytest.mark.parametrize("axes", ["x", "xyz"])
def test_a_scene_without_ports_runs_no_line_of_theirs(axes: str) -> None:
    rig = Rig(WALL, axes=axes)
    at = [-1e-3] + [0.0] * (len(axes) - 1)
    rig.go(at, ticks=20)
    rig.sample.time_ns += 1_000_000
    run = operations_by_code(partial(rig.tick.advance, rig.sample, PERIOD_S))
    assert not [code.co_qualname for code in run if "remote" in code.co_filename]


def test_a_port_that_no_client_drives_costs_a_comparison_an_axis() -> None:
    def cost(scene: str) -> int:
        rig = Rig(scene, axes="xyz")
        rig.go([-1e-3, 0.0, 0.0], ticks=20)
        rig.sample.time_ns += 1_000_000
        return count_operations(partial(rig.tick.advance, rig.sample, PERIOD_S))

    without = cost(WALL)
    assert cost(WALL + COUPLING) - without <= 3 * 35


def test_one_that_was_let_go_costs_no_more_than_one_that_no_client_has_driven() -> None:
    rig = Rig(axes="xyz")
    assert not any(channel.awake for channel in rig["tool"].channels)
    held_at(rig, [1e-3, 0.0, 0.0], 20)
    assert all(channel.awake for channel in rig["tool"].channels)
    rig["tool"].take(update(rig.seq + 1, released=True))
    rig.go(ticks=RAMP_TICKS + 5)
    assert not any(channel.awake for channel in rig["tool"].channels)
    assert rig["tool"].asleep
