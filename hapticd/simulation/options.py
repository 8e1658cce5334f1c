"""[device.options] of a simulated device: what it weighs, where it rubs, how it senses, who holds it."""

from __future__ import annotations

import csv
import itertools
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from hapticd.driver import DriverOptions
from hapticd.simulation.presets import PRESETS
from hapticd.simulation.space_options import SpaceOptions

FARTHEST_M = 1e6
"""A model that has gone this far from its wall has diverged [m]."""

MAX_DELAY_SAMPLES = 128
_FORCE = 1e6  # [N], far beyond any hand: a bound only against slips of the pen


def _zero_or_at_least(least: float) -> AfterValidator:
    def check(value: float) -> float:
        if 0.0 < value < least:
            raise ValueError(f"must be 0 or at least {least:g}")
        return value

    return AfterValidator(check)


Newton = Annotated[float, Field(ge=-_FORCE, le=_FORCE)]
Seconds = Annotated[float, Field(ge=0.0, le=1e9)]


class ConstantForce(DriverOptions):
    """The same force all the time."""

    profile: Literal["constant"] = "constant"
    newton: Newton = Field(0.0, description="force along the outward normal, negative presses [N]")


class StepForce(DriverOptions):
    """One force before, another from a time on."""

    profile: Literal["step"] = "step"
    newton: Newton = Field(description="force from at_s on [N]")
    from_newton: Newton = Field(0.0, description="force before [N]")
    at_s: Seconds = Field(0.0, description="time of the step [s]")


class RampForce(DriverOptions):
    """A straight line from one force to another."""

    profile: Literal["ramp"] = "ramp"
    newton: Newton = Field(description="force at the end and after [N]")
    from_newton: Newton = Field(0.0, description="force at the start and before [N]")
    at_s: Seconds = Field(0.0, description="when the ramp starts [s]")
    duration_s: float = Field(ge=1e-6, le=1e9, description="how long it takes [s]")


class SineForce(DriverOptions):
    """A sine about an offset."""

    profile: Literal["sine"] = "sine"
    newton: Newton = Field(description="amplitude [N]")
    offset_newton: Newton = Field(0.0, description="mean [N]")
    frequency_hz: float = Field(ge=0.0, le=1e6, description="frequency [Hz]")


class ChirpForce(DriverOptions):
    """A sine whose frequency rises or falls in a straight line, then stays."""

    profile: Literal["chirp"] = "chirp"
    newton: Newton = Field(description="amplitude [N]")
    offset_newton: Newton = Field(0.0, description="mean [N]")
    start_hz: float = Field(ge=0.0, le=1e6, description="frequency at the start [Hz]")
    end_hz: float = Field(ge=0.0, le=1e6, description="frequency at the end and after [Hz]")
    duration_s: float = Field(ge=1e-6, le=1e9, description="how long the sweep takes [s]")


class PressAndReleaseForce(DriverOptions):
    """A hand that presses and lets go, smoothly, again and again; it starts released."""

    profile: Literal["press-and-release"] = "press-and-release"
    newton: Newton = Field(-3.0, description="force when pressed hardest [N]")
    release_newton: Newton = Field(0.0, description="force when let go; positive draws back [N]")
    period_s: float = Field(1.0, ge=1e-6, le=1e9, description="time of one press and release [s]")


class RecordedForce(DriverOptions):
    """A recorded force: straight lines between points, the first before them and the last after."""

    profile: Literal["recorded"] = "recorded"
    points: tuple[tuple[Seconds, Newton], ...] = Field(
        (), max_length=10_000_000, description="[time s, force N] pairs, in order of time"
    )
    file: str | None = Field(
        None, description="CSV file of such pairs, with or without a header line; read when points is empty"
    )
    repeat: bool = Field(False, description="start again after the last point")

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, keys: Any) -> Any:
        if isinstance(keys, dict) and isinstance(keys.get("file"), str) and not keys.get("points"):
            return {**keys, "points": _recorded_points(Path(keys["file"]))}
        return keys

    @model_validator(mode="after")
    def _in_order(self) -> RecordedForce:
        if not self.points:
            raise ValueError("a recorded force needs points or a file")
        times = [time for time, _ in self.points]
        if any(later <= earlier for earlier, later in itertools.pairwise(times)):
            raise ValueError("points must be in order of time, each later than the one before")
        if self.repeat and times[-1] <= 0.0:
            raise ValueError("repeat needs a last point later than 0 s")
        return self


HandForce = Annotated[
    ConstantForce | StepForce | RampForce | SineForce | ChirpForce | PressAndReleaseForce | RecordedForce,
    Field(discriminator="profile"),
]


class Hand(DriverOptions):
    """[device.options.hand]: the hand that holds the device, linear, and the force that it means to give."""

    force: HandForce = Field(
        default_factory=ConstantForce, description="force along the outward normal, negative presses"
    )
    mass_kg: float = Field(0.0, ge=0.0, le=1e6, description="mass that moves with the device [kg]")
    damping_n_s_per_m: float = Field(0.0, ge=0.0, le=1e6, description="damping towards the world [N s/m]")
    stiffness_n_per_m: float = Field(0.0, ge=0.0, le=1e9, description="spring that rests at x = 0 [N/m]")


class Change(DriverOptions):
    """One entry of changes: new values from some time on."""

    at_s: Seconds = Field(description="device time of the first period with the new values [s]")
    mass_kg: float | None = Field(None, ge=1e-9, le=1e6, description="new mass [kg]")
    viscous_n_s_per_m: float | None = Field(None, ge=-1e6, le=1e9, description="new viscous friction [N s/m]")
    coulomb_n: Annotated[float, _zero_or_at_least(1e-12)] | None = Field(
        None, ge=0.0, le=_FORCE, description="new Coulomb friction [N]"
    )
    max_force_n: float | None = Field(None, ge=0.0, le=_FORCE, description="new saturation, 0 = none [N]")
    hand_mass_kg: float | None = Field(None, ge=0.0, le=1e6, description="new mass of the hand [kg]")
    hand_damping_n_s_per_m: float | None = Field(None, ge=0.0, le=1e6, description="new damping of the hand [N s/m]")
    hand_stiffness_n_per_m: float | None = Field(None, ge=0.0, le=1e9, description="new spring of the hand [N/m]")

    @model_validator(mode="after")
    def _changes_something(self) -> Change:
        if not self.values():
            raise ValueError("name at least one new value")
        return self

    def values(self) -> dict[str, float]:
        """The new values by name, without those that stay."""
        return {
            name: value
            for name in type(self).model_fields
            if name != "at_s" and (value := getattr(self, name)) is not None
        }


class Flexible(DriverOptions):
    """flexible: the handle hangs on the motor by a spring and a damper, and so the device swings by itself."""

    frequency_hz: float = Field(
        ge=1e-3, le=1e6, description="at which it swings with both ends free, without a hand [Hz]"
    )
    handle_share: float = Field(ge=1e-3, le=0.999, description="share of mass_kg at the handle, behind the spring")
    damping_ratio: float = Field(0.02, ge=0.0, le=10.0, description="of that swing")
    sensor: Literal["motor", "handle"] = Field(
        "motor", description="the end whose position is measured; that is where the wall is"
    )

    def spring(self, mass_kg: float) -> tuple[float, float]:
        """Stiffness [N/m] and damping [N s/m] between the ends of a device of this mass."""
        reduced_kg = mass_kg * self.handle_share * (1.0 - self.handle_share)
        turns = 2.0 * math.pi * self.frequency_hz
        return turns * turns * reduced_kg, 2.0 * self.damping_ratio * turns * reduced_kg


class Accuracy(DriverOptions):
    """accuracy: largest errors against the full model, exactly stepped, over the first seconds of the configuration."""

    position_m: float | None = Field(None, gt=0.0, le=1.0, description="of the true position at any tick [m]")
    energy_j: float | None = Field(None, gt=0.0, le=1e6, description="of the energy into the walls at any tick [J]")
    over_s: float = Field(2.0, ge=0.1, le=10.0, description="from the first tick, as long as this [s]")

    @model_validator(mode="after")
    def _asks_for_something(self) -> Accuracy:
        if self.position_m is None and self.energy_j is None:
            raise ValueError("name position_m, energy_j or both")
        return self


class SimulationOptions(DriverOptions):
    """[device.options] of a simulated device. `model` fills the keys that the file does not set."""

    model: Literal["omega7", "paper-simulation", "hapkit", "falcon"] = Field(
        "omega7",
        description="preset for mass, friction, resolution and force; a model, not a fact about hardware",
    )
    mass_kg: float = Field(0.25, ge=1e-9, le=1e6, description="mass that moves [kg]")
    viscous_n_s_per_m: float = Field(
        4.4, ge=-1e6, le=1e9, description="viscous friction; negative makes the device active [N s/m]"
    )
    coulomb_n: Annotated[float, _zero_or_at_least(1e-12)] = Field(
        0.0, ge=0.0, le=_FORCE, description="Coulomb friction, the same at rest and sliding [N]"
    )
    resolution_m: Annotated[float, _zero_or_at_least(1e-12)] = Field(
        1e-5, ge=0.0, le=1.0, description="step of the measured position, 0 = continuous [m]"
    )
    noise_m: float = Field(
        0.0, ge=0.0, le=1.0, description="standard deviation of sensor noise; never beyond 3.5 of it [m]"
    )
    seed: int = Field(1, ge=0, le=2**53, description="seed of the noise; the same seed gives the same noise anywhere")
    max_force_n: float = Field(
        12.0, ge=0.0, le=_FORCE, description="force at which the actuator saturates, 0 = never [N]"
    )
    bandwidth_hz: Annotated[float, _zero_or_at_least(1e-3)] = Field(
        0.0, ge=0.0, le=1e9, description="corner of the first-order actuator, 0 = immediate [Hz]"
    )
    force_delay_samples: int = Field(
        0, ge=0, le=MAX_DELAY_SAMPLES, description="periods between a write and its force on the device"
    )
    force_delay_s: float = Field(
        0.0, ge=0.0, le=1e3, description="time besides these from the sample to the force, any part of a period [s]"
    )
    flexible: Flexible | None = Field(None, description="a spring between motor and handle; unset: a rigid device")
    initial_position_m: float = Field(0.0, ge=-1e3, le=1e3, description="start relative to the wall, > 0 outside [m]")
    initial_velocity_m_per_s: float = Field(
        0.0, ge=-1e3, le=1e3, description="velocity at the start, > 0 outward [m/s]"
    )
    clock: Literal["ticks", "wall"] = Field(
        "ticks",
        description="ticks: one period per read, whatever the host does; wall: periods that really elapsed",
    )
    integrator: Literal["exact", "explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4"] = Field(
        "exact", description="how the device moves between samples; exact is the closed form, see docs/accuracy.md"
    )
    substeps: int = Field(1, ge=1, le=1000, description="steps of the integrator a period; exact takes one")
    accuracy: Accuracy | None = Field(
        None, description="take the cheapest integrator and terms that err by no more than this"
    )
    hand: Hand = Field(default_factory=Hand, description="who holds the device")
    axes: Literal[1, 2, 3] = Field(
        1, description="1: across the first wall; 2 or 3: x, y and z, counted from the origin of the scene"
    )
    space: SpaceOptions = Field(
        default_factory=SpaceOptions, description="with several axes, what is not alike along each"
    )
    changes: tuple[Change, ...] = Field((), description="new values from some time on")

    @property
    def largest_force_n(self) -> float:
        """The force at which the actuator saturates, the largest one where that changes; `inf`: it never does [N]."""
        changed = [change.max_force_n for change in self.changes if change.max_force_n is not None]
        return max(limit_n or math.inf for limit_n in (self.max_force_n, *changed))

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, keys: Any) -> Any:
        if isinstance(keys, dict):
            preset = keys.get("model", "omega7")
            if isinstance(preset, str) and preset in PRESETS:
                return {**PRESETS[preset], **keys}
        return keys

    @model_validator(mode="after")
    def _changes_in_order(self) -> SimulationOptions:
        times = [change.at_s for change in self.changes]
        if any(later <= earlier for earlier, later in itertools.pairwise(times)):
            raise ValueError("changes must be in order of at_s, each later than the one before")
        return self

    @model_validator(mode="after")
    def _integrator_fits(self) -> SimulationOptions:
        if self.integrator == "exact" and self.substeps != 1:
            raise ValueError("substeps must be 1 with the exact integrator, which needs no more")
        if self.accuracy is not None and (self.integrator != "exact" or self.clock != "ticks"):
            raise ValueError('accuracy chooses the integrator itself, and needs clock = "ticks"')
        return self

    @model_validator(mode="after")
    def _exact_terms_fit(self) -> SimulationOptions:
        asked = [name for name in ("force_delay_s", "flexible") if getattr(self, name)]
        for name in asked:
            if self.axes > 1:
                raise ValueError(f"{name} needs axes = 1")
            if self.integrator != "exact" or self.accuracy is not None:
                raise ValueError(f'{name} is stepped exactly: needs integrator = "exact" and no accuracy')
            if self.bandwidth_hz:
                raise ValueError(f"{name} needs bandwidth_hz = 0: the lag of an actuator is a mean over whole periods")
        if self.flexible is not None and (self.coulomb_n or any(change.coulomb_n for change in self.changes)):
            raise ValueError("flexible needs coulomb_n = 0: two masses that bend do not stop together")
        return self

    @model_validator(mode="after")
    def _axes_fit(self) -> SimulationOptions:
        if self.axes == 1:
            if self.space != SpaceOptions():
                raise ValueError("space needs axes = 2 or 3")
            return self
        if self.initial_position_m or self.initial_velocity_m_per_s:
            raise ValueError("with several axes, say where the device starts in space.position_m and velocity_m_per_s")
        if self.hand.force != ConstantForce():
            raise ValueError("with several axes, say what the hand does in space.hand.force")
        if self.accuracy is not None or self.clock != "ticks":
            raise ValueError('several axes need clock = "ticks", and no accuracy to be chosen for')
        coupled = self.space.mass_matrix_kg is not None or self.space.linkage != "none"
        friction = self.coulomb_n or any(self.space.coulomb_n or ()) or any(c.coulomb_n for c in self.changes)
        if coupled and (friction or self.integrator != "exact" or self.changes):
            raise ValueError("a mass matrix takes the exact integrator, no Coulomb friction and no changes")
        return self


def _recorded_points(file: Path) -> tuple[tuple[float, float], ...]:
    try:
        with file.open(newline="", encoding="utf-8") as lines:
            rows = [row for row in csv.reader(lines) if row and not row[0].lstrip().startswith("#")]
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from error
    points = []
    for number, row in enumerate(rows):
        try:
            time_s, newton = (float(cell) for cell in row)
        except ValueError:
            if number == 0:
                continue  # a header
            raise ValueError(f"{file}: row {number + 1}: {','.join(row)!r} is not `time s, force N`") from None
        points.append((time_s, newton))
    return tuple(points)
