"""What a tick of a shape costs, in counted instructions of the interpreter."""

from __future__ import annotations

from hapticd.offline.operations import count_operations
from hapticd.shapes.pose import Pose
from hapticd.shapes.proxy import follow
from hapticd.shapes.reach import Nearby
from hapticd.shapes.solid import Placed, Proxy
from tests.shapes.walks import CONVEX, HERE, TORUS, Point, go, stand


def pressed(proxy: Proxy, at: Point) -> int:
    """Instructions of a tick of a slow stroke."""
    x, y, z = at
    stand(proxy, (x, y, z + 2e-3))
    for tick in range(5):
        go(proxy, (x + 1e-5 * tick, y, z))
    assert proxy.touching
    return count_operations(lambda: follow(proxy, proxy.others, proxy.voxels, x + 6e-5, y, z))


def looked(balls: int) -> int:
    nearby = Nearby([Proxy([Placed("sphere", Pose.of((0.05 * at, 0.0, 0.0)), radius_m=0.01)]) for at in range(balls)])
    nearby.look(0.0, 0.0, 0.011)
    return count_operations(lambda: nearby.moved_out(0.0, 0.0, 0.0111))


def test_sixty_three_solids_out_of_reach_cost_what_one_does() -> None:
    assert looked(64) == looked(2)
    assert looked(64) < 60


def test_a_mesh_costs_a_few_times_a_ball_and_friction_less_than_half_more() -> None:
    ball = pressed(Proxy([CONVEX["sphere"]]), (0.0, 0.0, 0.0115))
    rough = pressed(Proxy([CONVEX["sphere"]], 0.5, 0.4), (0.0, 0.0, 0.0115))
    mesh = pressed(Proxy([Placed("mesh", HERE, field=TORUS)]), (0.015, 0.0, 0.0055))
    assert rough < 1.5 * ball
    assert mesh < 4.5 * ball
