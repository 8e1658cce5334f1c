"""Random devices, surfaces and hands: each is drawn from its seed and index alone, so that any can be replayed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from random import Random
from typing import Any

import numpy as np
import tomlkit

from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.models import LoopConfig
from hapticd.config.objects import OBJECT
from hapticd.errors import ConfigError
from hapticd.shapes.distance import shape_distance
from hapticd.shapes.pose import Vector
from hapticd.shapes.solid import Part
from hapticd.simulation.space.linkage import mass_matrix
from hapticd.tick.space.solid import placed
from hapticd_studies.boundaries import damper_peak
from hapticd_studies.draws import Draws, digits
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.space_robustness.surfaces import KINDS, Surface, surface

DURATION_S = 3.0
MAX_FORCE_N = 12.0
WITHIN_REACH = 0.8
"""A case is within reach of damping below this share of the damper peak of its lightest direction."""

HANDS = ("press", "stroke", "tap", "circle", "let go")
LETS_GO_S = 1.0

DRAWN = (
    "axes of 0.15-0.5 kg and 1-6 N s/m each, 4 in 10 by themselves (half of them with 0.02-0.2 N of Coulomb "
    "friction), 4 in 10 coupled by a mass matrix, 2 in 10 on a delta linkage; position steps of 1-30 um, 0.5-2 kHz, "
    "3 in 10 with one sample of force delay; a surface of 4-30 kN/m, facing any way, 5 in 10 with friction of 0.1-1, "
    f"dynamic 0.6-1 of static, one of {', '.join(KINDS)}; a hand of 0.5-6 N of a limit of 12 N that presses, strokes "
    "along the surface, taps, traces a circle (there the surface faces up) or lets go, holds its place by a spring of "
    "100-400 N/m and what a bulging surface takes to stay on, and damps 1-4 N s/m; it starts 0.01-3 mm off the surface"
)


@dataclass(frozen=True, slots=True)
class Case:
    """A device in a hand at a surface.

    Attributes:
        seed, index: what it was drawn from.
        surface: what it touches.
        hand: what the hand does, one of `HANDS`.
        options: `device.options` of its configuration.
        objects: the scene.
        rate_hz: loop rate [Hz].
        lightest_kg: mass of device and hand in their lightest direction.
        delay_samples: until a force acts.
    """

    seed: int
    index: int
    surface: Surface
    hand: str
    options: dict[str, Any]
    objects: list[dict[str, Any]]
    rate_hz: float
    lightest_kg: float
    delay_samples: int

    @property
    def name(self) -> str:
        """As `--only` takes it."""
        return f"{self.seed}:{self.index}"

    @property
    def period_s(self) -> float:
        """Time between ticks, as the daemon rounds it [s]."""
        return LoopConfig(rate_hz=self.rate_hz).period_s

    @property
    def stiffness_n_per_m(self) -> float:
        """Of its stiffest surface [N/m]."""
        return max(float(each["stiffness_n_per_m"]) for each in self.objects)

    @property
    def rough(self) -> bool:
        """Whether there is friction."""
        return float(self.objects[0]["static_friction"]) > 0.0

    @property
    def peak_share(self) -> float:
        """Stiffness as a share of the most that any damping holds on the lightest direction."""
        return self.stiffness_n_per_m / damper_peak(self.lightest_kg, self.period_s, self.delay_samples)

    @property
    def within_reach(self) -> bool:
        """Whether damping could hold it with something to spare."""
        return self.peak_share < WITHIN_REACH

    def config(self, law: LawSpec) -> str:
        """A configuration that runs it, TOML."""
        return tomlkit.dumps(
            {
                "loop": {"rate_hz": self.rate_hz},
                "device": {"driver": "loopback", "options": self.options},
                "scene": {"objects": self.objects},
                "controller": {"law": law.name, "params": dict(law.values)},
                "safety": {"max_force_n": MAX_FORCE_N},
            }
        )

    def loaded(self, law: LawSpec) -> LoadedConfig:
        """The same, checked."""
        return parse(self.config(law), f"{self.name} {law.label}")

    def figures(self) -> dict[str, float | int | str]:
        """Its parameters as columns of a table."""
        return {
            "surface": self.surface.kind,
            "hand": self.hand,
            "rough": int(self.rough),
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "rate_hz": self.rate_hz,
            "force_delay_samples": self.delay_samples,
            "lightest_kg": self.lightest_kg,
            "share_of_damper_peak": self.peak_share,
            "within_reach": int(self.within_reach),
        }


@lru_cache(maxsize=4096)
def draw(seed: int, index: int) -> Case:
    """The case of a seed and an index."""
    source = Draws(f"hapticd space robustness {seed}:{index}")
    uniform, logarithmic = source.even, source.logarithmic
    # Kinds go round, so that a few cases show them all; every number is drawn whether it is used or not.
    kind, hand = KINDS[index % len(KINDS)], HANDS[index // len(KINDS) % len(HANDS)]
    touched = surface(source, kind, hand != "circle")
    stiffness, softer = logarithmic(4e3, 3e4), uniform(0.3, 0.9)
    static, slips = uniform(0.1, 1.0), uniform(0.6, 1.0)
    rough, late, coupling = source.random() < 0.5, source.random() < 0.3, source.random()
    friction = {"static_friction": static, "dynamic_friction": digits(static * slips)} if rough else {}
    objects = [{**each, "stiffness_n_per_m": stiffness, "static_friction": 0.0, **friction} for each in touched.objects]
    if kind == "two surfaces":
        objects[1]["stiffness_n_per_m"] = digits(softer * stiffness)
    masses = [uniform(0.15, 0.5) for _ in "xyz"]
    viscous, coulomb_n = [uniform(1.0, 6.0) for _ in "xyz"], [uniform(0.02, 0.2) for _ in "xyz"]
    newton, lean, amplitude = uniform(0.5, 6.0), uniform(0.0, 0.3), uniform(0.3, 1.5)
    start_m, spring, damping, hand_kg = (
        logarithmic(1e-5, 3e-3),
        uniform(100.0, 400.0),
        uniform(1.0, 4.0),
        uniform(0, 0.1),
    )
    if touched.bend_per_m > 0.0:  # else the hand slips off
        spring = digits(spring + 2.0 * newton * touched.bend_per_m)
    pace, radius_m = uniform(0.5, 1.5), logarithmic(5e-4, 4e-3)
    rubs = source.random() < 0.5
    turn = _turn(source)
    force, aim = _moves(hand, touched, newton, lean, amplitude, pace, radius_m)

    resolution_m = logarithmic(1e-6, 3e-5)
    at, normal = np.array(touched.at_m), np.array(touched.normal)
    while _shown_inside(objects, at + start_m * normal, resolution_m):  # by the sensor's steps: a step farther off
        start_m += resolution_m
    own, in_space, matrix = _inertia(coupling, masses, turn, coulomb_n if rubs else [], touched.at_m)
    options: dict[str, Any] = {
        "axes": 3,
        "resolution_m": resolution_m,
        "max_force_n": MAX_FORCE_N,
        "force_delay_samples": int(late),
        "space": {
            "position_m": _list(at + start_m * normal),
            **in_space,
            "viscous_n_s_per_m": viscous,
            "hand": {
                "force": force,
                "aim": aim,
                "mass_kg": [hand_kg] * 3,
                "damping_n_s_per_m": [damping] * 3,
                "stiffness_n_per_m": [spring] * 3,
            },
        },
        **own,
    }
    rate_hz = logarithmic(500.0, 2000.0)
    lightest_kg = float(np.linalg.eigvalsh(matrix).min()) + hand_kg
    return Case(seed, index, touched, hand, options, objects, rate_hz, lightest_kg, int(late))


def case_of(text: str) -> Case:
    """The case of `SEED:INDEX`.

    Raises:
        ConfigError: it is none.
    """
    found = re.fullmatch(r"(\d{1,18}):(\d{1,9})", text)
    if found is None:
        raise ConfigError(f"--only {text}: must be SEED:INDEX, as 1:75")
    return draw(int(found[1]), int(found[2]))


def _moves(
    hand: str, touched: Surface, newton: float, lean: float, amplitude: float, pace_hz: float, radius_m: float
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Force and aim of a hand, as the options of the device have them.

    Args:
        hand: what it does.
        touched: the surface.
        newton: how firmly it presses [N].
        lean: how much of that a press leans along the surface.
        amplitude: of the force along it that a stroke has [N].
        pace_hz: of strokes, taps and circles [Hz].
        radius_m: of a circle [m].
    """
    normal, along = np.array(touched.normal), np.array(touched.along)
    press, at_m = _list(-newton * normal), _list(np.array(touched.at_m))
    hold = {"path": "hold", "at_m": at_m}
    match hand:
        case "press":
            force = _list(-newton * (normal + lean * along))
            return {"profile": "press", "newton": force, "duration_s": 0.2}, hold
        case "stroke":
            stroke = {"profile": "stroke", "newton": press, "along_newton": _list(amplitude * along)}
            return {**stroke, "frequency_hz": pace_hz}, hold
        case "tap":
            tap = {"profile": "tap", "newton": press, "period_s": digits(1.0 / pace_hz)}
            return {**tap, "release_newton": _list(0.5 * normal)}, hold
        case "circle":
            circle = {"path": "circle", "centre_m": at_m, "radius_m": radius_m, "frequency_hz": pace_hz}
            return {"profile": "constant", "newton": press}, circle
        case _:
            return {"profile": "let-go", "newton": press, "at_s": LETS_GO_S}, hold


def _inertia(
    coupling: float, masses_kg: list[float], turn: Any, coulomb_n: list[float], at_m: Vector
) -> tuple[dict[str, Any], dict[str, Any], Any]:
    """How the axes are coupled: what that adds to the options of the device, to those in space, and the mass matrix.

    Args:
        coupling: below 0.4: not at all, below 0.8: by a constant matrix, else by a linkage.
        masses_kg: by axis, as the case may be of the matrix turned straight [kg].
        turn: rotation of the matrix.
        coulomb_n: friction of axes by themselves, none where it is empty [N].
        at_m: where the matrix is looked at [m].
    """
    if coupling < 0.4:
        friction = {"coulomb_n": coulomb_n} if coulomb_n else {}
        return {}, {"mass_kg": masses_kg, **friction}, np.diag(masses_kg)
    if coupling < 0.8:
        matrix = turn @ np.diag(masses_kg) @ turn.T
        matrix = 0.5 * (matrix + matrix.T)
        return {}, {"mass_matrix_kg": matrix.tolist()}, matrix
    matrix = np.array(mass_matrix(masses_kg[0], [0.0] * 3, *at_m))
    return {"mass_kg": masses_kg[0]}, {"linkage": "delta"}, matrix


def _turn(source: Random) -> Any:
    """A random rotation."""
    matrix, _ = np.linalg.qr(np.array([[source.gauss(0.0, 1.0) for _ in range(3)] for _ in range(3)]))
    return matrix


def _shown_inside(objects: list[dict[str, Any]], at_m: Any, resolution_m: float) -> bool:
    """Whether a sensor shows a place as one inside an object, where a run is refused to begin."""
    shown_m = _list(np.round(at_m / resolution_m) * resolution_m)
    for each in objects:
        shape = placed(OBJECT.validate_python(each))
        if shape_distance(Part(shape, shape.pose), (), *shape.pose.own(shown_m))[0] < 0.0:
            return True
    return False


def _list(vector: Any) -> list[float]:
    return [float(value) for value in vector]
