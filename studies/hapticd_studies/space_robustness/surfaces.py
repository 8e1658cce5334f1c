"""Random surfaces to touch: the objects of a scene, and a point on them with the normal there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from hapticd.shapes.pose import Pose, Vector
from hapticd_studies.draws import Draws, digits

KINDS = (
    "plane",
    "ball",
    "cup",
    "box face",
    "rounded edge",
    "capsule",
    "cylinder",
    "pipe",
    "corner of a room",
    "notch of a union",
    "two surfaces",
)

_HALF = math.sqrt(0.5)


@dataclass(frozen=True, slots=True)
class Surface:
    """What a device is pressed on.

    Attributes:
        kind: one of `KINDS`.
        objects: tables of the scene, without what makes a surface stiff or rough.
        at_m: a point on the surface, which the device presses.
        normal: there.
        along: a direction along the surface, in which it stays as it is for some way.
        bend_per_m: its largest curvature, where it bulges.
    """

    kind: str
    objects: tuple[dict[str, Any], ...]
    at_m: Vector
    normal: Vector
    along: Vector
    bend_per_m: float


@dataclass(slots=True)
class _Own:
    """The same in a frame of its own, before it is put anywhere."""

    objects: list[dict[str, Any]]
    at_m: Vector
    normal: Vector = (0.0, 0.0, 1.0)
    along: Vector = (0.0, 1.0, 0.0)
    bend_per_m: float = 0.0
    places: list[Vector] = field(default_factory=lambda: [(0.0, 0.0, 0.0)])


def surface(source: Draws, kind: str, turned: bool) -> Surface:
    """A random surface of a kind, at a random place.

    Args:
        source: of all that is drawn.
        kind: one of `KINDS`.
        turned: whether it faces any way; else its normal is along z, or as near to that as its kind has it.
    """
    own = _own(source, kind)
    facing = [source.gauss(0.0, 1.0) for _ in range(4)]
    turn = [digits(value) for value in facing] if turned else [1.0, 0.0, 0.0, 0.0]
    origin = [source.even(-0.02, 0.02) for _ in range(3)]
    pose = Pose.of(origin, turn)
    objects = tuple(
        {
            "name": f"{kind} {count}" if len(own.objects) > 1 else kind,
            **table,
            "position_m": list(pose.point(place)),
            "orientation": turn,
        }
        for count, (table, place) in enumerate(zip(own.objects, own.places, strict=True), start=1)
    )
    return Surface(kind, objects, pose.point(own.at_m), pose.out(own.normal), pose.out(own.along), own.bend_per_m)


def _own(source: Draws, kind: str) -> _Own:
    r = source.even(0.01, 0.05)
    off = source.even(0.002, 0.01)
    rounding = source.even(0.002, 0.006)
    side = 0.08
    half = 0.5 * side
    box: dict[str, Any] = {"shape": "box", "size_m": [side] * 3}
    long: dict[str, Any] = {"radius_m": r, "length_m": side}
    match kind:
        case "plane":
            return _Own([{"shape": "plane"}], (0.0, 0.0, 0.0))
        case "ball":
            return _Own([{"shape": "sphere", "radius_m": r}], (0.0, 0.0, r), bend_per_m=1.0 / r)
        case "cup":
            return _Own([{"shape": "sphere", "radius_m": r, "inside": True}], (0.0, 0.0, -r))
        case "box face":
            return _Own([box], (half - off, 0.0, half))
        case "rounded edge":
            out = half - rounding * (1.0 - _HALF)
            return _Own(
                [{**box, "rounding_m": rounding}], (out, 0.0, out), (_HALF, 0.0, _HALF), bend_per_m=1.0 / rounding
            )
        case "capsule":
            return _Own([{"shape": "capsule", **long}], (0.0, 0.0, half + r), bend_per_m=1.0 / r)
        case "cylinder":
            return _Own(
                [{"shape": "cylinder", **long}], (r, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), bend_per_m=1.0 / r
            )
        case "pipe":
            return _Own(
                [{"shape": "cylinder", **long, "inside": True}], (r, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
            )
        case "corner of a room":
            return _Own([{**box, "inside": True}], (half, 0.0, -half), (-_HALF, 0.0, _HALF))
        case _:  # one box stands on the other; `draw` makes the second of two surfaces softer
            places = [(0.0, 0.0, -half), (-half, 0.0, half)]
            return _Own([box, dict(box)], (0.0, 0.0, 0.0), (_HALF, 0.0, _HALF), places=places)
