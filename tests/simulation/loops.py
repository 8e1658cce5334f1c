"""Loops to be run both ways: a wide family of them, and few that are chosen to reach every line and bound."""

from __future__ import annotations

import math
import random
from typing import Any, Literal

from hapticd import plugins
from hapticd.config.models import LoopConfig
from hapticd.config.walls import WallConfig
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from tests.simulation import awkward_law
from tests.simulation.both_ways import Case

LAWS = {name: plugins.law(name) for name in ("none", "energy-cycle", "tdpa")} | {"awkward": awkward_law}
TICKS = 400


def any_case(law: str, seed: int, few_terms: bool = False) -> Case:
    """A loop of the family; the same one for the same seed.

    Args:
        law: one of `LAWS`.
        seed: which loop.
        few_terms: a device without delay, lag, friction, integrators and a hand that changes.
    """
    dice = random.Random(f"{law} {seed}")

    def one_in(n: int) -> bool:
        return dice.randrange(n) == 0

    def decades(low: float, high: float) -> float:
        return float(10.0 ** dice.uniform(low, high))

    period_s = LoopConfig(rate_hz=dice.choice([100.0, 300.0, 700.0, 1000.0, 1000.0, 1500.0, 3000.0, 8000.0])).period_s
    duration_s = TICKS * period_s

    def times(most: int) -> list[float]:
        return sorted({dice.uniform(0.0, 1.1 * duration_s) for _ in range(dice.randrange(most + 1))})

    saturation = 0.0 if one_in(3) else decades(-0.5, 2.0)
    push = -decades(-1.0, 1.0)
    profile = dice.choice(["constant", "step", "ramp", "sine", "chirp", "press-and-release", "recorded"])
    at_s, long_s = dice.uniform(0.0, 0.5 * duration_s), dice.uniform(0.05, 0.6) * duration_s
    forces: dict[str, dict[str, Any]] = {
        "constant": {"newton": push},
        "step": {"newton": push, "from_newton": 0.3, "at_s": at_s},
        "ramp": {"newton": push, "from_newton": 0.3, "at_s": at_s, "duration_s": long_s},
        "sine": {"newton": -push, "offset_newton": 0.3 * push, "frequency_hz": 1.0 / long_s},
        "chirp": {
            "newton": -push, "offset_newton": 0.3 * push, "start_hz": 1.0 / long_s, "end_hz": 4.0 / long_s,
            "duration_s": long_s,
        },
        "press-and-release": {"newton": push, "release_newton": -0.3 * push, "period_s": long_s},
        "recorded": {"points": ((0.0, 0.0), (at_s + 1e-6, push), (at_s + long_s, -0.5 * push)), "repeat": one_in(2)},
    }  # fmt: skip
    keys: dict[str, Any] = {
        "model": dice.choice(["omega7", "paper-simulation", "hapkit", "falcon"]),
        "max_force_n": saturation,
        "initial_position_m": decades(-5.0, -2.5),
        "initial_velocity_m_per_s": dice.choice([0.0, -0.3]),
        "hand": {
            "force": {"profile": profile, **forces[profile]},
            "mass_kg": dice.choice([0.0, 0.2]),
            "damping_n_s_per_m": dice.choice([0.0, 2.0]),
            "stiffness_n_per_m": dice.choice([0.0, 0.0, 80.0]),
        },
        "changes": [
            {"at_s": time_s, **dice.choice([{"coulomb_n": 0.05}, {"viscous_n_s_per_m": -2.0}, {"mass_kg": 0.1}])}
            for time_s in times(2)
        ],
    }
    if one_in(2):
        keys |= {"noise_m": decades(-7.0, -4.0), "seed": dice.randrange(10**6)}
        keys["initial_position_m"] += 4.0 * keys["noise_m"]  # it never says that it starts inside
    if one_in(2):
        keys["resolution_m"] = dice.choice([0.0, 1e-6, 1e-4])
    if one_in(2):
        keys["force_delay_samples"] = dice.randrange(4)
    if one_in(3):
        keys["bandwidth_hz"] = decades(1.5, 3.0)
    if one_in(3):
        keys["coulomb_n"] = decades(-3.0, 0.0)
    if one_in(4):
        keys |= {
            "integrator": dice.choice(["explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4"]),
            "substeps": dice.randrange(1, 4),
        }
    if few_terms:
        keys = {name: keys[name] for name in ("max_force_n", "initial_position_m", "noise_m", "seed") if name in keys}
        keys |= {"model": "paper-simulation", "hand": shaking(2.0 * push, 1.0 / long_s, 0.3 * push)}
    wall = {
        "stiffness_n_per_m": dice.choice([0.0, decades(2.0, 4.5), decades(2.0, 4.5)]),
        "damping_n_s_per_m": dice.choice([0.0, 0.0, dice.uniform(-3.0, 10.0)]),
        "changes": [
            {"at_s": time_s, **dice.choice([{"stiffness_n_per_m": decades(2, 4.5)}, {"damping_n_s_per_m": 2.0}])}
            for time_s in times(3)
        ],
    }
    limit_n = saturation or math.inf
    if not one_in(3):
        limit_n = min(decades(-0.5, 1.2), limit_n)
    params: dict[str, Any] = {}
    if law == "awkward":
        params = {"share": dice.choice([1.0, -0.5, 3.0]), "push_n": dice.uniform(-1.0, 3.0)}
    elif law == "energy-cycle" and one_in(2):
        params = dice.choice([
            {"work": "total", "rule": "signed", "cap": "none"},
            {"pairing": "held-power", "sum": "start", "rule": "non-negative", "cap": "fixed"},
            {"contact_loss": "ignored", "cap": "known-mass", "window": 1},
        ])  # fmt: skip
    elif law == "tdpa" and one_in(2):
        params = dice.choice([{"observer": "printed", "min_speed_m_per_s": 0.0}, {"carry_debt": False}])
    return Case(
        LAWS[law],
        Point(
            SimulationOptions.model_validate(keys),
            WallConfig.model_validate(wall),
            LAWS[law].Params(**params),
            period_s,
            limit_n,
            dice.choice([1, 1, 2, 3, 7, 64]),
            target_m=dice.choice([-1e-3, 0.0, 1e-3]),
            band_m=decades(-5.0, -2.0),
        ),
        TICKS,
    )


def a_case(
    law: str,
    device: dict[str, Any],
    wall: dict[str, Any],
    ticks: int,
    params: dict[str, Any] | None = None,
    safety: Literal["both", "axis", "magnitude"] = "both",
    stepwise: bool = True,
    **point: Any,
) -> Case:
    """A loop that is written down."""
    model = LAWS[law]
    options = SimulationOptions.model_validate(device)
    defaults = {"target_m": 0.0, "max_force_n": options.largest_force_n}
    given = Point(options, WallConfig.model_validate(wall), model.Params(**(params or {})), **{**defaults, **point})
    return Case(model, given, ticks, min(50, ticks), stepwise=stepwise, safety=safety)


def constant(newton: float) -> dict[str, Any]:
    return {"force": {"profile": "constant", "newton": newton}}


def shaking(newton: float, hertz: float, offset: float) -> dict[str, Any]:
    return {"force": {"profile": "sine", "newton": newton, "offset_newton": offset, "frequency_hz": hertz}}


FREE = {"model": "paper-simulation", "viscous_n_s_per_m": 0.0, "resolution_m": 0.0, "max_force_n": 0.0}
SOFT = {"stiffness_n_per_m": 100.0}
NO_WALL = {"stiffness_n_per_m": 0.0}


def chosen_cases() -> list[Case]:
    """Few and short loops that reach every line, and each bound from both sides to the last bit."""
    noisy = {"model": "omega7", "noise_m": 1e-6, "initial_position_m": 2e-4}
    changing = {
        "stiffness_n_per_m": 9000.0,
        "damping_n_s_per_m": 2.0,
        "changes": [
            {"at_s": 0.0603, "stiffness_n_per_m": 14000.0},
            {"at_s": 0.0607, "damping_n_s_per_m": -1.0},
            {"at_s": 0.12, "stiffness_n_per_m": 3000.0},
        ],
    }
    pushy = {"share": 1.1, "push_n": 0.75}
    aging = [{"at_s": 0.05, "coulomb_n": 0.1}, {"at_s": 0.1, "mass_kg": 0.1}]
    still = {**FREE, "initial_position_m": 2.0**-10, "coulomb_n": 0.1}
    # On a grid of powers of two a wall may stand elsewhere and look the other way, and nothing is rounded.
    grid = {"model": "omega7", "resolution_m": 2.0**-17, "initial_position_m": 1e-3}
    turned = {"stiffness_n_per_m": 9000.0, "damping_n_s_per_m": 1.0, "position_m": 0.5, "free_side": "negative"}
    wild = {**FREE, "initial_position_m": 1e-4, "hand": shaking(6.0, 20.0, -1.0)}
    pulling = {"share": -1.0, "push_n": -0.5}
    cases = [
        a_case(
            "awkward", {**noisy, "hand": shaking(6.0, 11.0, -1.0)}, changing, 240, pushy,
            max_force_n=7.0, velocity_samples=3, target_m=-3e-4, band_m=2e-4,
        ),
        a_case(
            "energy-cycle", {**noisy, "noise_m": 0.0, "hand": shaking(5.0, 9.0, -2.0), "changes": aging}, changing, 240,
            target_m=1e-4, band_m=1e-4,
        ),
        a_case("tdpa", {**grid, "hand": shaking(6.0, 30.0, -2.0)}, turned, 60, max_force_n=5.0, velocity_samples=2),
        a_case(
            "none", {**noisy, "hand": constant(-1.0)}, {"stiffness_n_per_m": 900.0}, 300, target_m=-1e-3, band_m=4e-4
        ),
        # Out of the wall and exactly onto its surface.
        a_case(
            "none", {**grid, "resolution_m": 2.0**-12, "hand": shaking(6.0, 15.0, -1.0)},
            {"stiffness_n_per_m": 3000.0}, 250,
        ),
        # Exactly at the edge of its band, on either side of the target.
        a_case("none", still, NO_WALL, 5, target_m=0.0, band_m=2.0**-10),
        a_case("none", still, NO_WALL, 5, target_m=2.0**-9, band_m=2.0**-10),
        # In the segments that it has.
        a_case("awkward", {**noisy, "hand": shaking(6.0, 11.0, -1.0), "changes": aging}, changing, 160, stepwise=False),
        a_case("awkward", FREE, SOFT, 7, {"at": 1, "then_mass_kg": 1e18}, stepwise=False),
        a_case("awkward", {**FREE, "hand": constant(-50.0)}, SOFT, 7, {"at": 5, "then_n": 1e18}, stepwise=False),
        # Outside a wall a law may ask for anything.
        a_case("awkward", {**FREE, "initial_position_m": 1.0}, SOFT, 7, {"at": 3, "then_n": 2e18}),
    ]  # fmt: skip
    cases += [
        a_case("awkward", wild, {"stiffness_n_per_m": 4000.0}, 120, pulling, limit, max_force_n=3.0)
        for limit in ("both", "axis", "magnitude")
    ]
    for key in ("then_n", "then_damping_n_s_per_m", "then_mass_kg"):
        for most in (1e18, math.nextafter(1e18, 0.0)):
            for value in (most, -most):
                pressed = {**FREE, "max_force_n": 12.0, "hand": constant(-50.0)}
                cases.append(a_case("awkward", pressed, SOFT, 6, {"at": 5, key: value}, max_force_n=12.0))
    metres = {**FREE, "resolution_m": 1.0}
    for sign in (1.0, -1.0):
        for less_m in (0.0, 1.0):
            # x = a t^2 / 2: the tenth sample is at the farthest position, the first has the largest velocity.
            far = {**metres, "mass_kg": 1.0, "hand": constant(sign * (1e6 - less_m) * 2.0 / 5.0**2)}
            fast = {**metres, "mass_kg": 1e-4, "hand": constant(sign * (1e3 - less_m) * 2.0 * 1e2)}
            cases.append(a_case("none", far, NO_WALL, 10, period_s=0.5))
            cases += [a_case("none", fast, NO_WALL, 1, velocity_samples=samples) for samples in (1, 2)]
    return cases
