"""[device.options.space]: what a simulated device with several axes has along each, and the hand that holds it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hapticd.settings import Table

MAX_DELAY_SAMPLES = 128

_FORCE = 1e6  # [N], as of one axis
_Newton = Annotated[float, Field(ge=-_FORCE, le=_FORCE)]
_Metre = Annotated[float, Field(ge=-1e3, le=1e3)]
_Seconds = Annotated[float, Field(ge=0.0, le=1e9)]
_Frequency = Annotated[float, Field(gt=0.0, le=1e6)]

Newtons = Annotated[tuple[_Newton, ...], Field(min_length=2, max_length=3)]
Metres = Annotated[tuple[_Metre, ...], Field(min_length=2, max_length=3)]
Positives = Annotated[tuple[Annotated[float, Field(ge=0.0, le=1e9)], ...], Field(min_length=2, max_length=3)]


class ConstantPush(Table):
    """The same force all the time."""

    profile: Literal["constant"] = "constant"
    newton: Newtons | None = Field(None, description="force along each axis; unset: none [N]")


class PressPush(Table):
    """A force that comes on along a straight line and stays."""

    profile: Literal["press"] = "press"
    newton: Newtons = Field(description="force at the end, along each axis [N]")
    at_s: _Seconds = Field(0.0, description="when it begins [s]")
    duration_s: float = Field(0.1, ge=1e-6, le=1e9, description="how long it takes to come on [s]")


class TapPush(Table):
    """A force that comes and goes, smoothly, again and again; it starts released."""

    profile: Literal["tap"] = "tap"
    newton: Newtons = Field(description="force when pressed hardest, along each axis [N]")
    release_newton: Newtons | None = Field(None, description="force when let go; unset: none [N]")
    period_s: float = Field(0.5, ge=1e-6, le=1e9, description="time of one tap [s]")


class StrokePush(Table):
    """A force that presses, and one that swings along the surface."""

    profile: Literal["stroke"] = "stroke"
    newton: Newtons = Field(description="force that presses, along each axis [N]")
    along_newton: Newtons = Field(description="amplitude of the force that swings, along each axis [N]")
    frequency_hz: _Frequency = Field(0.5, description="strokes a second [Hz]")


class LetGoPush(Table):
    """A force that ends at once."""

    profile: Literal["let-go"] = "let-go"
    newton: Newtons = Field(description="force before, along each axis [N]")
    at_s: _Seconds = Field(description="when the hand lets go [s]")


Push = Annotated[
    ConstantPush | PressPush | TapPush | StrokePush | LetGoPush,
    Field(discriminator="profile"),
]


class HoldPath(Table):
    """The hand aims at one point."""

    path: Literal["hold"] = "hold"
    at_m: Metres = Field(description="the point [m]")


class LinePath(Table):
    """The hand goes to and fro between two points, smoothly."""

    path: Literal["line"] = "line"
    from_m: Metres = Field(description="where it starts [m]")
    to_m: Metres = Field(description="the other end [m]")
    period_s: float = Field(2.0, ge=1e-6, le=1e9, description="time there and back [s]")


class CirclePath(Table):
    """The hand traces a circle about an axis."""

    path: Literal["circle"] = "circle"
    centre_m: Metres = Field(description="its centre [m]")
    radius_m: float = Field(gt=0.0, le=1e3, description="its radius [m]")
    about: Literal["x", "y", "z"] = Field("z", description="axis that the circle goes about")
    frequency_hz: _Frequency = Field(0.5, description="rounds a second [Hz]")


Path = Annotated[HoldPath | LinePath | CirclePath, Field(discriminator="path")]


class SpaceHand(Table):
    """[device.options.space.hand]: force and impedance of the hand along each axis.

    A spring of the hand pulls towards `aim`; along one axis either the force or the aim may change in time.
    """

    force: Push = Field(default_factory=ConstantPush, description="the force that the hand means to give")
    aim: Path | None = Field(None, description="where the hand's spring pulls to; unset: the origin")
    mass_kg: Positives | None = Field(None, description="mass that moves with the device; unset: hand.mass_kg [kg]")
    damping_n_s_per_m: Positives | None = Field(None, description="damping; unset: hand.damping_n_s_per_m [N s/m]")
    stiffness_n_per_m: Positives | None = Field(None, description="spring; unset: hand.stiffness_n_per_m [N/m]")


class SpaceOptions(Table):
    """[device.options.space]: an element an axis, where one number for all of them is not enough."""

    mass_kg: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)] | None = Field(
        None, description="mass along each axis; unset: mass_kg [kg]"
    )
    mass_matrix_kg: tuple[tuple[float, ...], ...] | None = Field(
        None, description="the whole mass matrix, symmetric, row by row, in the place of mass_kg [kg]"
    )
    linkage: Literal["none", "delta"] = Field(
        "none",
        description="delta: three arms carry the device, and its mass matrix changes with position (docs/space.md)",
    )
    viscous_n_s_per_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)] | None = Field(
        None, description="viscous friction along each axis; unset: viscous_n_s_per_m [N s/m]"
    )
    coulomb_n: Positives | None = Field(None, description="Coulomb friction along each axis; unset: coulomb_n [N]")
    resolution_m: Positives | None = Field(None, description="step of each position; unset: resolution_m [m]")
    noise_m: Positives | None = Field(None, description="noise of each position; unset: noise_m [m]")
    max_force_n: Positives | None = Field(None, description="saturation of each actuator; unset: max_force_n [N]")
    bandwidth_hz: Positives | None = Field(None, description="corner of each actuator; unset: bandwidth_hz [Hz]")
    force_delay_samples: (
        Annotated[tuple[Annotated[int, Field(ge=0, le=MAX_DELAY_SAMPLES)], ...], Field(min_length=2, max_length=3)]
        | None
    ) = Field(None, description="delay of each actuator; unset: force_delay_samples")
    position_m: Metres | None = Field(None, description="where the device starts; unset: the origin [m]")
    velocity_m_per_s: Metres | None = Field(None, description="how fast it starts; unset: at rest [m/s]")
    hand: SpaceHand = Field(default_factory=SpaceHand, description="who holds the device")
