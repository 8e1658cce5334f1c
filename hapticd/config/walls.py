"""[[scene.walls]]: planes across one axis."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from pydantic import Field, field_validator, model_validator

from hapticd.settings import Table

MAX_WALLS = 8
"""Most walls in a scene: the size of a tick record is fixed when the ring is made."""

Axis = Literal["x", "y", "z"]

MAX_CHANGES = 50
"""Most changes of a wall over time: a running loop takes a wall over in the time between two ticks."""


class WallChange(Table):
    """One entry of scene.walls.changes: new values from some time on."""

    at_s: float = Field(ge=0.0, description="seconds after the wall's first tick [s]")
    stiffness_n_per_m: float | None = Field(None, ge=0.0, le=1e9, description="new stiffness [N/m]")
    damping_n_s_per_m: float | None = Field(None, ge=-1e6, le=1e6, description="new damping [N s/m]")

    @model_validator(mode="after")
    def _changes_something(self) -> WallChange:
        if self.stiffness_n_per_m is None and self.damping_n_s_per_m is None:
            raise ValueError("must name a new stiffness_n_per_m or damping_n_s_per_m")
        return self


class WallConfig(Table):
    """[[scene.walls]]: a plane across one axis that pushes towards its free side."""

    axis: Axis = Field("z", description="axis that the plane is normal to")
    free_side: Literal["positive", "negative"] = Field("positive", description="side of the plane that is free")
    position_m: float = Field(0.0, ge=-10.0, le=10.0, description="where the plane is on the axis [m]")
    stiffness_n_per_m: float = Field(ge=0.0, le=1e9, description="spring stiffness [N/m]")
    damping_n_s_per_m: float = Field(
        0.0, ge=-1e6, le=1e6, description="damping of the wall itself [N s/m]; negative makes the wall active"
    )
    changes: tuple[WallChange, ...] = Field(
        (), max_length=MAX_CHANGES, description="changes of stiffness or damping over time, at most fifty"
    )

    @field_validator("changes")
    @classmethod
    def _changes_in_order(cls, changes: tuple[WallChange, ...]) -> tuple[WallChange, ...]:
        if any(later.at_s <= earlier.at_s for earlier, later in pairwise(changes)):
            raise ValueError("must be in order of at_s, each later than the one before")
        return changes
