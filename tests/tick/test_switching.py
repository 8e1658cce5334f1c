"""Any sequence of switches in a closed loop: what is written is finite, bounded, and no step but motion and ramps."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.config.safety import SafetyConfig
from hapticd.errors import ConfigError
from hapticd.law import LawParams
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd.tick.contact import RunningLaw
from hapticd_controllers import energy_cycle, none, tdpa
from tests.examples import examples
from tests.tick.rig import LIMIT_N, PERIOD_S, RAMP_TICKS, Rig, scene, wall

LAWS: dict[str, tuple[Any, LawParams]] = {
    "none": (none, none.Params()),
    "energy-cycle": (energy_cycle, energy_cycle.Params()),
    "energy-cycle without a cap": (energy_cycle, energy_cycle.Params(cap="none", small_leaks=0.0, rule="signed")),
    "energy-cycle of all work": (energy_cycle, energy_cycle.Params(work="total", window=1)),
    "tdpa": (tdpa, tdpa.Params()),
    "tdpa as published": (
        tdpa,
        tdpa.Params(damping_cap_n_s_per_m=0.0, min_speed_m_per_s=0.0, reset="never", observer="printed"),
    ),
}

SCENES: dict[str, list[dict[str, Any]]] = {
    "free space": [],
    "a wall": [wall(12000.0)],
    "a damped wall": [wall(12000.0, damping_n_s_per_m=5.0)],
    "an active wall": [wall(12000.0, damping_n_s_per_m=-2.0)],
    "a wall that is far too stiff": [wall(1e6)],
    "a wall that changes": [wall(12000.0, changes=[{"at_s": 0.004, "stiffness_n_per_m": 20000.0}])],
    "a wall elsewhere": [wall(12000.0, position_m=3e-4)],
    "three walls": [wall(6000.0), wall(6000.0), wall(12000.0, position_m=-1e-4)],
    "a slot": [wall(12000.0), wall(12000.0, position_m=2e-4, free_side="negative")],
}

SAFETY: dict[str, dict[str, Any]] = {
    "the device's": {},
    "half the force": {"max_force_n": 6.0},
    "a short ramp": {"ramp_s": 0.02},
    "more than there is": {"max_force_n": 50.0},
    "for simulation": {"profile": "simulation"},
}

HAND = SimulationOptions.model_validate(
    {
        "mass_kg": 0.25,
        "viscous_n_s_per_m": 4.4,
        "resolution_m": 1e-5,
        "max_force_n": LIMIT_N,
        "initial_position_m": -2e-4,
        "hand": {"force": {"profile": "constant", "newton": -3.0}, "stiffness_n_per_m": 500.0},
    }
)

SWITCHES = st.tuples(
    st.sampled_from([None, *LAWS]),
    st.sampled_from([None, *SCENES]),
    st.sampled_from([None, *SAFETY]),
    st.integers(0, 80),
)


def law_of(name: str) -> Callable[[], RunningLaw]:
    module, params = LAWS[name]
    return RunningLaw(module, params).another


def step_bound_n(contact: Any, force_n: float, x_m: float, requested_n: float) -> float:
    """Largest change of a contact's force in a tick that a ramp and the motion explain [N].

    In a blend, F = (1 - w) F_old min(1, x / x_old) + w F_new: the ramp, the motion's part of the old force, and what
    law and wall ask for anew, as far as the limit lets it.

    Args:
        contact: the contact after the tick.
        force_n: its force before it [N].
        x_m: where it was then [m].
        requested_n: what law and wall asked for then [N].
    """
    limit_n = contact.blend_limit_n
    ramp_n = (abs(contact.blend_from_n) + min(limit_n, abs(contact.requested_n))) / contact.blend_ticks
    asked_n = abs(clipped(contact.requested_n, limit_n) - clipped(requested_n, limit_n))
    let_out_n: float = abs(contact.blend_from_n / contact.blend_from_x_m * (contact.x_m - x_m))
    return float(ramp_n) + asked_n + let_out_n


def clipped(force_n: float, limit_n: float) -> float:
    return max(-limit_n, min(limit_n, force_n))


@examples(150)
@given(path=st.lists(SWITCHES, min_size=1, max_size=12))
def test_whatever_is_switched_to_whatever_the_force_is_bounded_and_goes_by_ramps(
    path: list[tuple[str | None, str | None, str | None, int]],
) -> None:
    device = SimulatedDevice(HAND, PERIOD_S)
    rig = Rig(wall(12000.0), at_m=device.measured_m, resolution_m=1e-5, simulated=True)
    tick = rig.tick
    force_n = rig.force(device.measured_m, ticks=RAMP_TICKS)
    for law, walls, safety, ticks in path:
        try:
            rig.switch(
                None if walls is None else scene(*SCENES[walls]),
                None if safety is None else SafetyConfig.model_validate(SAFETY[safety]),
                None if law is None else law_of(law),
            )
        except ConfigError:
            assert safety == "more than there is"
        for number in range(ticks):
            before: dict[Any, tuple[float, float, float, float]] = {
                contact: (contact.applied_n, contact.force_n, contact.x_m, contact.requested_n)
                for contact in [*tick.contacts, *tick.leaving]
                if contact.in_contact
            }
            largest_n = tick.guard.max_force_n
            device.advance(force_n)
            force_n = rig.force(device.measured_m)
            assert math.isfinite(force_n)
            assert abs(force_n) <= max(largest_n, tick.guard.max_force_n) * (1.0 + 1e-9)
            for contact, was in before.items():
                if not contact.in_contact or not contact.blending:
                    continue
                if number == 0 and contact.blend_tick == 0.0:  # switched: what was applied, let out with the depth
                    held_n = was[0] * min(1.0, contact.x_m / was[2])
                    assert contact.force_n == pytest.approx(held_n, abs=1e-12)
                elif number > 0 and contact.blend_tick <= contact.blend_ticks:  # w < 1
                    assert abs(contact.force_n - was[1]) <= step_bound_n(contact, *was[1:]) + 1e-9


@examples(60)
@given(path=st.lists(SWITCHES, min_size=1, max_size=8))
def test_a_debt_is_carried_through_every_switch(
    path: list[tuple[str | None, str | None, str | None, int]],
) -> None:
    """The books of a wall that stays are not touched by what is switched on it."""
    device = SimulatedDevice(HAND, PERIOD_S)
    rig = Rig(wall(12000.0), at_m=device.measured_m, resolution_m=1e-5, simulated=True)
    force_n = 0.0
    for law, _, safety, ticks in path:
        for _ in range(ticks):
            device.advance(force_n)
            force_n = rig.force(device.measured_m)
        debt_j = rig.tick.contacts[0].ledger.debt_j
        assert debt_j >= 0.0
        usable = safety in ("the device's", "half the force", "a short ramp")
        limits = SafetyConfig.model_validate(SAFETY[safety]) if safety and usable else None
        rig.switch(scene(wall(12000.0)), limits, None if law is None else law_of(law))
        (contact,) = rig.tick.contacts
        assert contact.ledger.debt_j == debt_j
        assert contact.snapshot(0.0).debt_j == debt_j
