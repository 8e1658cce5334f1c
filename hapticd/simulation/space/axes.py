"""A device with several axes as one device an axis: what its vectors say along each, the hand's path included."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hapticd.simulation.options import (
    ConstantForce,
    HandForce,
    PressAndReleaseForce,
    RampForce,
    SimulationOptions,
    SineForce,
    StepForce,
)
from hapticd.simulation.space_options import (
    CirclePath,
    ConstantPush,
    HoldPath,
    LetGoPush,
    LinePath,
    Path,
    PressPush,
    Push,
    StrokePush,
    TapPush,
)

AXES = ("x", "y", "z")

_PER_AXIS = (
    "mass_kg",
    "viscous_n_s_per_m",
    "coulomb_n",
    "resolution_m",
    "noise_m",
    "max_force_n",
    "bandwidth_hz",
    "force_delay_samples",
)


def axis_options(options: SimulationOptions) -> list[SimulationOptions]:
    """The device along each of its axes.

    Raises:
        ValueError: a vector has not one element an axis, or force and aim both change along one axis.
    """
    return [_along(options, axis) for axis in range(options.axes)]


def _along(options: SimulationOptions, axis: int) -> SimulationOptions:
    space, hand = options.space, options.space.hand
    values: dict[str, Any] = {name: _element(options, name, axis) for name in _PER_AXIS}
    impedance = {
        name: _of(options, f"hand.{name}", getattr(hand, name), axis, getattr(options.hand, name))
        for name in ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m")
    }
    stiffness = impedance["stiffness_n_per_m"]
    forces = [*_pushes(options, hand.force, axis), *_aims(options, hand.aim, axis, stiffness)]
    return options.model_copy(
        update={
            **values,
            "axes": 1,
            "seed": (options.seed + axis * 7919) % 2**53,  # else the noise of all axes would be one
            "initial_position_m": _of(options, "position_m", space.position_m, axis, 0.0),
            "initial_velocity_m_per_s": _of(options, "velocity_m_per_s", space.velocity_m_per_s, axis, 0.0),
            "hand": options.hand.model_copy(update={**impedance, "force": _combined(forces, axis)}),
        }
    )


def _element(options: SimulationOptions, name: str, axis: int) -> Any:
    return _of(options, name, getattr(options.space, name), axis, getattr(options, name))


def _of(options: SimulationOptions, name: str, vector: Sequence[Any] | None, axis: int, default: Any) -> Any:
    """What a vector says along one axis."""
    if vector is None:
        return default
    if len(vector) != options.axes:
        raise ValueError(f"space.{name}: has {len(vector)} elements for {options.axes} axes")
    return vector[axis]


def _pushes(options: SimulationOptions, push: Push, axis: int) -> list[HandForce]:
    """What the hand means to push, along one axis: parts that add up."""

    def along(name: str) -> float:
        return float(_of(options, f"hand.force.{name}", getattr(push, name), axis, 0.0))

    newton = along("newton")
    match push:
        case ConstantPush():
            return [ConstantForce(newton=newton)]
        case PressPush():
            return [RampForce(newton=newton, at_s=push.at_s, duration_s=push.duration_s)] if newton else []
        case TapPush():
            release = along("release_newton")
            if newton == release:
                return [ConstantForce(newton=newton)]
            return [PressAndReleaseForce(newton=newton, release_newton=release, period_s=push.period_s)]
        case StrokePush():
            swing = along("along_newton")
            if swing == 0.0:
                return [ConstantForce(newton=newton)]
            return [SineForce(newton=swing, offset_newton=newton, frequency_hz=push.frequency_hz)]
        case LetGoPush():
            return [StepForce(newton=0.0, from_newton=newton, at_s=push.at_s)] if newton else []


def _aims(options: SimulationOptions, path: Path | None, axis: int, stiffness: float) -> list[HandForce]:
    """A spring that rests where the hand aims is one that rests at the origin, and a force."""

    def along(name: str) -> float:
        return float(stiffness * _of(options, f"hand.aim.{name}", getattr(path, name), axis, 0.0))

    match path:
        case None:
            return []
        case HoldPath():
            return [ConstantForce(newton=along("at_m"))]
        case LinePath():
            start, end = along("from_m"), along("to_m")
            if start == end:
                return [ConstantForce(newton=start)]
            return [PressAndReleaseForce(newton=end, release_newton=start, period_s=path.period_s)]
        case CirclePath():
            centre, reach = along("centre_m"), stiffness * path.radius_m
            plane = [index for index in range(3) if AXES[index] != path.about]
            if axis not in plane or reach == 0.0:
                return [ConstantForce(newton=centre)]
            if axis == plane[0]:  # a cosine: the device starts on the circle
                period_s = 1.0 / path.frequency_hz
                return [PressAndReleaseForce(newton=centre - reach, release_newton=centre + reach, period_s=period_s)]
            return [SineForce(newton=reach, offset_newton=centre, frequency_hz=path.frequency_hz)]


def _combined(forces: Sequence[HandForce], axis: int) -> HandForce:
    """One force that is the sum of all; one of them may change in time."""
    offset = sum([force.newton for force in forces if isinstance(force, ConstantForce)])
    changing = [force for force in forces if not isinstance(force, ConstantForce)]
    if not changing:
        return ConstantForce(newton=offset)
    if len(changing) > 1:
        raise ValueError(f"space.hand: force and aim both change along {AXES[axis]}; one of them may")
    force = changing[0]
    if offset == 0.0:
        return force
    update: dict[str, float] = {}
    if isinstance(force, SineForce):
        update = {"offset_newton": force.offset_newton + offset}
    elif isinstance(force, PressAndReleaseForce):
        update = {"newton": force.newton + offset, "release_newton": force.release_newton + offset}
    elif isinstance(force, StepForce | RampForce):
        update = {"newton": force.newton + offset, "from_newton": force.from_newton + offset}
    return force.model_copy(update=update)
