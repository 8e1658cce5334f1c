"""A device as the step wants it: fields of its start, its coefficients from each change on, the terms that it needs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hapticd.config.timing import first_tick
from hapticd.simulation.options import (
    MAX_DELAY_SAMPLES,
    ChirpForce,
    ConstantForce,
    Flexible,
    PressAndReleaseForce,
    RampForce,
    RecordedForce,
    SimulationOptions,
    SineForce,
    StepForce,
)
from hapticd.simulation.plant.flexible import TwoMasses, flexible_fields, rigid_fields
from hapticd.simulation.plant.hand import (
    PROFILE_CHIRP,
    PROFILE_CONSTANT,
    PROFILE_PRESS,
    PROFILE_RAMP,
    PROFILE_RECORDED,
    PROFILE_SINE,
    PROFILE_STEP,
)
from hapticd.simulation.plant.hold import flow
from hapticd.simulation.plant.stepped import METHODS

_SWINGS_PER_PERIOD = 10.0

MOST_GROWTH = 100.0
"""An active device may grow e^100-fold in a period: what a step makes of it is still a number."""

MOST_TURNS = 1e5
"""The spring of the hand may swing this many times in a period: 1e-16 of an angle each time, and the phase is known."""

LONGEST_PERIOD_S = 1e6

_PROFILES: dict[type[Any], int] = {
    ConstantForce: PROFILE_CONSTANT,
    StepForce: PROFILE_STEP,
    RampForce: PROFILE_RAMP,
    SineForce: PROFILE_SINE,
    ChirpForce: PROFILE_CHIRP,
    PressAndReleaseForce: PROFILE_PRESS,
    RecordedForce: PROFILE_RECORDED,
}


def start_state(options: SimulationOptions) -> dict[str, float | int]:
    """Fields of `PlantState` before the first sample is taken."""
    seed = options.seed
    return {
        "x_m": float(options.initial_position_m),
        "v_m_per_s": float(options.initial_velocity_m_per_s),
        "measured_m": 0.0,
        "applied_n": 0.0,
        "lag_n": 0.0,
        "tick": 0,
        "line_at": 0,
        "point_at": 0,
        "noise_a": 1 + seed * 69069 % 2147483562,
        "noise_b": 1 + (seed * 1664525 + 1013904223) % 2147483398,
        "pushed_n": 0.0,
        "before_n": 0.0,
        "change_n": 0.0,
        "stretch_m": 0.0,
        "stretch_m_per_s": 0.0,
    }


def epochs(
    options: SimulationOptions, period_s: float, coupled: bool = False
) -> list[tuple[int, dict[str, float | int]]]:
    """The parameters from each change on, as (first tick, fields of `PlantParams`); the first is tick 0.

    Args:
        options: a device with one axis.
        period_s: time between samples [s].
        coupled: it is an axis of a device whose axes share a mass matrix.

    Raises:
        ValueError: the device grows or swings too fast for the rate; names the parameter and its limit.
    """
    values = {
        "mass_kg": options.mass_kg,
        "viscous_n_s_per_m": options.viscous_n_s_per_m,
        "coulomb_n": options.coulomb_n,
        "max_force_n": options.max_force_n,
        "hand_mass_kg": options.hand.mass_kg,
        "hand_damping_n_s_per_m": options.hand.damping_n_s_per_m,
        "hand_stiffness_n_per_m": options.hand.stiffness_n_per_m,
    }
    found: dict[int, dict[str, float | int]] = {0: _params(options, values, period_s, coupled)}
    for change in options.changes:
        values.update(change.values())
        found[first_tick(change.at_s, period_s)] = _params(options, values, period_s, coupled)
    return sorted(found.items())


def terms(options: SimulationOptions, coupled: bool = False) -> dict[str, bool]:
    """Which switches of `step` and `hand` a device needs on, as one by itself or as one of several axes."""
    return {
        "COUPLED": coupled,
        "DELAY": options.force_delay_samples > 0 or options.force_delay_s > 0.0,
        "LATE": options.force_delay_s > 0.0,
        "FLEXIBLE": options.flexible is not None,
        "SATURATION": options.max_force_n > 0.0 or any(change.max_force_n for change in options.changes),
        "LAG": options.bandwidth_hz > 0.0,
        "SPRING": options.hand.stiffness_n_per_m > 0.0 or any(c.hand_stiffness_n_per_m for c in options.changes),
        "FRICTION": options.coulomb_n > 0.0 or any(change.coulomb_n for change in options.changes),
        "NOISE": options.noise_m > 0.0,
        "QUANTISED": options.resolution_m > 0.0,
        "STEPPED": options.integrator != "exact",
        "EXPLICIT": options.integrator == "explicit-euler",
        "SEMI_IMPLICIT": options.integrator == "semi-implicit-euler",
        "VERLET": options.integrator == "velocity-verlet",
        "RK4": options.integrator == "rk4",
        **_hand_terms(options),
    }


def delay_line(options: SimulationOptions, period_s: float) -> list[float]:
    """An empty delay line."""
    return [0.0] * (_delay(options, period_s)[0] + 1)


def recorded_points(options: SimulationOptions) -> tuple[list[float], list[float]]:
    """Times and forces of a recorded hand; one point at rest for any other."""
    force = options.hand.force
    if not isinstance(force, RecordedForce):
        return [0.0], [0.0]
    return [time_s for time_s, _ in force.points], [newton for _, newton in force.points]


def two_masses(flexible: Flexible, values: Mapping[str, float]) -> TwoMasses:
    """A flexible device and its hand.

    Args:
        flexible: the spring in it.
        values: of device and hand, by the names of `Change`.
    """
    mass_kg, share = values["mass_kg"], flexible.handle_share
    return TwoMasses(
        (1.0 - share) * mass_kg,
        share * mass_kg + values["hand_mass_kg"],
        values["viscous_n_s_per_m"],
        *flexible.spring(mass_kg),
        values["hand_stiffness_n_per_m"],
        values["hand_damping_n_s_per_m"],
        flexible.sensor == "motor",
    )


def _hand_terms(options: SimulationOptions) -> dict[str, bool]:
    """Which switches a hand needs on."""
    force = options.hand.force
    return {
        "HAND": not (isinstance(force, ConstantForce) and force.newton == 0.0),
        "TIMED": not isinstance(force, ConstantForce),
        "HAND_STEP": isinstance(force, StepForce),
        "HAND_RAMP": isinstance(force, RampForce),
        "HAND_SINE": isinstance(force, SineForce),
        "HAND_CHIRP": isinstance(force, ChirpForce),
        "HAND_PRESS": isinstance(force, PressAndReleaseForce),
        "HAND_RECORDED": isinstance(force, RecordedForce),
    }


def _hand_fields(options: SimulationOptions) -> dict[str, float | int]:
    """The fields of `PlantParams` that say what the hand does."""
    force = options.hand.force
    fields: dict[str, float | int] = {
        "hand_profile": _PROFILES[type(force)],
        "hand_n": 0.0,
        "hand_from_n": 0.0,
        "hand_at_s": 0.0,
        "hand_duration_s": 1.0,
        "hand_hz": 0.0,
        "hand_end_hz": 0.0,
        "hand_repeat": 0,
    }
    if isinstance(force, RecordedForce):
        fields["hand_repeat"] = int(force.repeat)
    else:
        fields["hand_n"] = force.newton
    if isinstance(force, StepForce | RampForce):
        fields |= {"hand_from_n": force.from_newton, "hand_at_s": force.at_s}
    if isinstance(force, RampForce | ChirpForce):
        fields["hand_duration_s"] = force.duration_s
    if isinstance(force, SineForce | ChirpForce):
        fields["hand_from_n"] = force.offset_newton
    if isinstance(force, SineForce):
        fields["hand_hz"] = force.frequency_hz
    if isinstance(force, ChirpForce):
        fields |= {"hand_hz": force.start_hz, "hand_end_hz": force.end_hz}
    if isinstance(force, PressAndReleaseForce):
        fields |= {"hand_from_n": force.release_newton, "hand_hz": 1.0 / force.period_s}
    return fields


def _delay(options: SimulationOptions, period_s: float) -> tuple[int, float]:
    """Whole periods between command and force, and what is left [s]."""
    whole = math.floor(options.force_delay_s / period_s + 1e-9)
    return options.force_delay_samples + whole, max(0.0, options.force_delay_s - whole * period_s)


def _params(
    options: SimulationOptions, values: dict[str, float], period_s: float, coupled: bool
) -> dict[str, float | int]:
    mass_kg = values["mass_kg"] + values["hand_mass_kg"]
    decay_per_s = (values["viscous_n_s_per_m"] + values["hand_damping_n_s_per_m"]) / mass_kg
    spring_n_per_m = values["hand_stiffness_n_per_m"]
    stiffness_per_s2 = spring_n_per_m / mass_kg
    _refuse_beyond_doubles(options, values, mass_kg, period_s)
    v_per_v, v_per_a, x_per_a = flow(decay_per_s, stiffness_per_s2, period_s)
    swing_per_s2 = stiffness_per_s2 - 0.25 * decay_per_s * decay_per_s
    half_swing_s = math.pi / math.sqrt(swing_per_s2) if swing_per_s2 > 0.0 else math.inf
    if values["coulomb_n"] > 0.0 and half_swing_s * _SWINGS_PER_PERIOD < period_s:
        raise ValueError(
            f"hand.stiffness_n_per_m = {spring_n_per_m:g}: with Coulomb friction the hand may swing at most "
            f"{_SWINGS_PER_PERIOD / 2:g} times in a period of {period_s:g} s"
        )
    lag_keep = lag_mean = 0.0
    if options.bandwidth_hz > 0.0:
        ratio = 2.0 * math.pi * options.bandwidth_hz * period_s
        lag_keep = math.exp(-ratio)
        lag_mean = -math.expm1(-ratio) / ratio
    delay_samples, late_s = _delay(options, period_s)
    return {
        "period_s": period_s,
        "x_per_v": v_per_a,
        "x_per_f": x_per_a / mass_kg,
        "v_per_v": v_per_v,
        "v_per_f": v_per_a / mass_kg,
        "spring_n_per_m": spring_n_per_m,
        "mass_kg": mass_kg,
        "decay_per_s": decay_per_s,
        "stiffness_per_s2": stiffness_per_s2,
        "half_swing_s": half_swing_s,
        "coulomb_n": values["coulomb_n"],
        "coupled": int(coupled),
        "limit_n": values["max_force_n"] or math.inf,
        "lag_keep": lag_keep,
        "lag_mean": lag_mean,
        "delay_samples": delay_samples,
        "late_s": late_s,
        "late_share": late_s / period_s,
        "method": METHODS.index(options.integrator),
        "substeps": options.substeps,
        "substep_s": period_s / options.substeps,
        "resolution_m": options.resolution_m,
        "noise_m": options.noise_m * math.sqrt(3.0),
        **_hand_fields(options),
        **_bending_fields(options, values, period_s, late_s),
    }


def _bending_fields(
    options: SimulationOptions, values: dict[str, float], period_s: float, late_s: float
) -> dict[str, float | int]:
    """The fields of `PlantParams` that say how the device bends, and what a force within a period does."""
    if options.flexible is not None:
        return flexible_fields(two_masses(options.flexible, values), period_s, late_s)
    if late_s == 0.0 or values["coulomb_n"] > 0.0:  # with friction, `move` goes on in two pieces
        return rigid_fields()
    mass_kg = values["mass_kg"] + values["hand_mass_kg"]
    decay_per_s = (values["viscous_n_s_per_m"] + values["hand_damping_n_s_per_m"]) / mass_kg
    stiffness_per_s2 = values["hand_stiffness_n_per_m"] / mass_kg
    _, early_v, early_x = flow(decay_per_s, stiffness_per_s2, late_s)
    slope, swing, area = flow(decay_per_s, stiffness_per_s2, period_s - late_s)
    pull = -stiffness_per_s2 * early_x
    return rigid_fields((early_x + early_v * swing + pull * area) / mass_kg, (early_v * slope + pull * swing) / mass_kg)


def _refuse_beyond_doubles(
    options: SimulationOptions, values: dict[str, float], mass_kg: float, period_s: float
) -> None:
    """Say which parameter leads to a step that double precision cannot hold."""
    if not 0.0 < period_s <= LONGEST_PERIOD_S:
        raise ValueError(f"period_s = {period_s:g}: must be more than 0 and at most {LONGEST_PERIOD_S:g} s")
    if options.force_delay_s > MAX_DELAY_SAMPLES * period_s:
        raise ValueError(
            f"force_delay_s = {options.force_delay_s:g}: must be at most {MAX_DELAY_SAMPLES} periods, "
            f"{MAX_DELAY_SAMPLES * period_s:g} s"
        )
    if options.flexible is not None:
        frequency_hz = options.flexible.frequency_hz
        if frequency_hz * period_s > MOST_TURNS:
            raise ValueError(
                f"flexible.frequency_hz = {frequency_hz:g}: must be at most {MOST_TURNS / period_s:g}, "
                f"{MOST_TURNS:g} swings in a period of {period_s:g} s"
            )
        motor_kg = (1.0 - options.flexible.handle_share) * values["mass_kg"]
        if -values["viscous_n_s_per_m"] / motor_kg * period_s > MOST_GROWTH:
            raise ValueError(
                f"viscous_n_s_per_m = {values['viscous_n_s_per_m']:g}: a motor of {motor_kg:g} kg would speed up more "
                f"than e^{MOST_GROWTH:g}-fold in a period of {period_s:g} s; must be "
                f"{-MOST_GROWTH * motor_kg / period_s:g} or more"
            )
    viscous = values["viscous_n_s_per_m"] + values["hand_damping_n_s_per_m"]
    grows = -viscous / mass_kg * period_s
    if grows > MOST_GROWTH:
        least = -MOST_GROWTH * mass_kg / period_s - values["hand_damping_n_s_per_m"]
        raise ValueError(
            f"viscous_n_s_per_m = {values['viscous_n_s_per_m']:g}: {mass_kg:g} kg would speed up e^{grows:.3g}-fold in "
            f"a period of {period_s:g} s; must be {least:g} or more"
        )
    spring_n_per_m = values["hand_stiffness_n_per_m"]
    turns = math.sqrt(spring_n_per_m / mass_kg) * period_s / (2.0 * math.pi)
    if turns > MOST_TURNS:
        most = (2.0 * math.pi * MOST_TURNS / period_s) ** 2 * mass_kg
        raise ValueError(
            f"hand.stiffness_n_per_m = {spring_n_per_m:g}: {mass_kg:g} kg would swing {turns:.3g} times in a period "
            f"of {period_s:g} s; must be at most {most:g}"
        )
