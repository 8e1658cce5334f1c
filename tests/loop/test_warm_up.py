"""The rehearsal before the first deadline is a healthy press, or what it warms is the way of a fault."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd.config.loading import parse
from hapticd.config.models import VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.loop.warm_up import TICKS, warm_up
from hapticd.tick.assemble import make_tick
from hapticd.tick.guard import Guard, Mode
from hapticd.tick.remote.port import PortState
from hapticd.tick.tick import ControlTick
from tests.tick.remote.rig import COUPLING, FORCE_PORT
from tests.tick.remote.rig import device as bench
from tests.tick.rig import device, law, running, scene, wall

RATES_HZ = (100.0, 1000.0, 4000.0, 8000.0)
KINDS: tuple[dict[str, Any], ...] = ({"has_clock": True}, {"has_sequence": True}, {})
SPEEDS_M_PER_S = (0.05, 2.0, math.inf)
WORKSPACES_M = ((-0.1, 0.1), (-math.inf, math.inf), (0.02, 0.3))


def every_rate_with_each_of_the_rest() -> list[tuple[float, dict[str, Any], float, tuple[float, float]]]:
    """A Latin square a rate: each rate meets each kind, speed and workspace; 12 of the 108 combinations."""
    return [
        (rate_hz, KINDS[j], SPEEDS_M_PER_S[(i + j) % 3], WORKSPACES_M[(i + 2 * j) % 3])
        for i, rate_hz in enumerate(RATES_HZ)
        for j in range(3)
    ]


@pytest.mark.parametrize(("rate_hz", "kind", "max_speed_m_per_s", "workspace_m"), every_rate_with_each_of_the_rest())
def test_it_is_armed_and_without_fault_to_its_end(
    rate_hz: float, kind: dict[str, Any], max_speed_m_per_s: float, workspace_m: tuple[float, float]
) -> None:
    """C8: time went on by a nanosecond a tick: hands of 5e5 m/s, and a latched guard for half of it."""
    inside: list[bool] = []

    def step(_state: Any, _params: Any, shown: Any) -> float:
        inside.append(shown.in_contact)
        assert abs(shown.velocity_m_per_s) < 1.0
        force_n: float = shown.contact_n
        return force_n

    info = device("xyz", workspace_m=(workspace_m,) * 3, simulated=max_speed_m_per_s == math.inf, **kind)
    safety = SafetyConfig(max_speed_m_per_s=None if max_speed_m_per_s == math.inf else max_speed_m_per_s)
    tick = ControlTick(
        scene(wall(axis="x", position_m=0.05), wall(axis="z", position_m=-0.05)),
        VelocityConfig(),
        Guard(safety, info),
        info,
        running(law(step)),
        1.0 / rate_hz,
        0.05,
    )
    warm_up(tick)
    assert tick.fault == 0, tick.fault_text
    assert tick.guard.mode is Mode.ARMED
    assert len(inside) == 2 * TICKS
    assert sum(inside) > 0.2 * TICKS
    assert not all(inside)


@pytest.mark.parametrize("axes", ["x", "xyz"])
def test_what_clients_drive_is_warm_as_well(axes: str) -> None:
    """Couplings, forces and objects are held and in force, each law is asked, and nothing stops for it."""
    ball = '[[scene.objects]]\nname = "ball"\nshape = "sphere"\nradius_m = 0.03\nstiffness_n_per_m = 2000.0\n'
    loaded = parse(COUPLING + FORCE_PORT + (ball + "remote = true\n" if axes == "xyz" else ""), "bench")
    tick = make_tick(loaded, bench(axes, simulated=False))
    warm_up(tick)
    assert tick.fault == 0, tick.fault_text
    assert tick.guard.mode is Mode.ARMED
    assert {port.kind for port in tick.ports} == {"coupling", "force", *(["object"] if axes == "xyz" else [])}
    for port in tick.ports:
        assert port.state is PortState.HELD
        assert any(port.impulse_n_s)
