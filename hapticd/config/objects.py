"""[[scene.objects]]: rigid shapes anywhere in space."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, field_validator, model_validator

from hapticd.settings import Table

MAX_OBJECTS = 64
"""Most objects in a scene."""

HOLD_S = 0.1
"""How long what a client said of a target or an object is good, unless told otherwise [s]."""

MAX_SPEED_M_PER_S = 1.0
"""How fast a target or an object follows its client, unless told otherwise [m/s]."""

_Metre = Annotated[float, Field(ge=-10.0, le=10.0)]
_Size = Annotated[float, Field(gt=0.0, le=10.0)]
_LEAST_LENGTH = 1e-6


class ObjectTable(Table):
    """What every object has, whatever its shape."""

    name: str = Field(
        min_length=1, max_length=40, description="its name, unique in the scene: who it is through a reload"
    )
    position_m: tuple[_Metre, _Metre, _Metre] = Field((0.0, 0.0, 0.0), description="where its own origin is [m]")
    orientation: tuple[float, float, float, float] = Field(
        (1.0, 0.0, 0.0, 0.0), description="how it is turned: a quaternion w x y z of any length"
    )
    inside: bool = Field(False, description="true: the device is kept inside, and all around is solid")
    stiffness_n_per_m: float = Field(ge=0.0, le=1e9, description="spring stiffness [N/m]")
    damping_n_s_per_m: float = Field(
        0.0, ge=-1e6, le=1e6, description="damping of the object itself along its normal [N s/m]"
    )
    static_friction: float = Field(0.0, ge=0.0, le=10.0, description="coefficient while the device sticks to it")
    dynamic_friction: float = Field(
        0.0, ge=0.0, le=10.0, description="coefficient while it slips, at most static_friction"
    )
    remote: bool = Field(False, description="true: a client moves it, by its name")
    hold_s: float | None = Field(
        None,
        gt=0.0,
        le=10.0,
        description="with remote = true: how long its motion goes on after the client's last message [s]; "
        f"unset: {HOLD_S}",
    )
    max_speed_m_per_s: float | None = Field(
        None,
        gt=0.0,
        le=10.0,
        description=f"with remote = true: how fast its origin follows the client [m/s]; unset: {MAX_SPEED_M_PER_S}",
    )

    @field_validator("orientation")
    @classmethod
    def _has_a_length(cls, orientation: tuple[float, ...]) -> tuple[float, ...]:
        if max(map(abs, orientation)) < _LEAST_LENGTH:
            raise ValueError("must be a quaternion w x y z that has a length, such as [1, 0, 0, 0]")
        return orientation

    @model_validator(mode="after")
    def _slips_no_harder_than_it_sticks(self) -> ObjectTable:
        if self.dynamic_friction > self.static_friction:
            raise ValueError(
                f"dynamic_friction = {self.dynamic_friction:g}: must be at most static_friction, "
                f"{self.static_friction:g}"
            )
        return self

    @model_validator(mode="after")
    def _only_a_remote_one_follows(self) -> ObjectTable:
        for key in ("hold_s", "max_speed_m_per_s"):
            if not self.remote and getattr(self, key) is not None:
                raise ValueError(f"{key} = {getattr(self, key):g}: only an object with remote = true has it")
        return self


class PlaneObject(ObjectTable):
    """A plane through its position, free on the side that its own z points to."""

    shape: Literal["plane"] = "plane"


class SphereObject(ObjectTable):
    """A sphere about its position."""

    shape: Literal["sphere"] = "sphere"
    radius_m: _Size = Field(description="its radius [m]")


class BoxObject(ObjectTable):
    """A box about its position."""

    shape: Literal["box"] = "box"
    size_m: tuple[_Size, _Size, _Size] = Field(description="its sides along its own x, y and z [m]")
    rounding_m: float = Field(0.0, ge=0.0, le=10.0, description="radius of its edges [m]")


class CapsuleObject(ObjectTable):
    """A cylinder along its own z with half a sphere on each end."""

    shape: Literal["capsule"] = "capsule"
    radius_m: _Size = Field(description="its radius [m]")
    length_m: _Size = Field(description="between the centres of its ends [m]")


class CylinderObject(ObjectTable):
    """A cylinder along its own z."""

    shape: Literal["cylinder"] = "cylinder"
    radius_m: _Size = Field(description="its radius [m]")
    length_m: _Size = Field(description="from end to end [m]")
    rounding_m: float = Field(0.0, ge=0.0, le=10.0, description="radius of its rims [m]")


class MeshObject(ObjectTable):
    """A mesh, as the distance field that `hapticd mesh` has made of it."""

    shape: Literal["mesh"] = "mesh"
    file: str = Field(min_length=1, description="the field, beside the configuration or with its whole path")


ObjectConfig = Annotated[
    PlaneObject | SphereObject | BoxObject | CapsuleObject | CylinderObject | MeshObject,
    Field(discriminator="shape"),
]

OBJECT: TypeAdapter[ObjectConfig] = TypeAdapter(ObjectConfig)
"""Checks one object by itself."""


def check_names(objects: tuple[ObjectTable, ...]) -> None:
    """Refuse two objects of one name.

    Raises:
        ValueError: there are such.
    """
    seen: set[str] = set()
    for each in objects:
        if each.name in seen:
            raise ValueError(f'two objects have the name "{each.name}"')
        seen.add(each.name)
