"""The scalars of shapes and proxies: fields of slotted objects in the loop, of records in compiled studies."""

from __future__ import annotations

from typing import get_type_hints

Scalar = type[float | int | bool]


class ShapeScalars:
    """A shape and where it is in the frame around; lengths in m.

    `sign` is 1 for a solid and -1 for a hollow; `a`, `b`, `c`, `r` are its sides, as `hapticd.shapes.distance` takes
    them; `px` and so on its position, `xx` and so on its rotation, row by row, `turned` whether it has one. A field
    has its first point at `ox`, `oy`, `oz`, `per_m` points a metre, goes `tx`, `ty`, `tz` spacings far, has its
    values from `offset` on, `row` and `sheet` of them between neighbours along y and x, and `margin` from the surface
    to the edge of its grid.
    """

    __slots__ = ()

    kind: int
    sign: float
    a: float
    b: float
    c: float
    r: float
    ox: float
    oy: float
    oz: float
    per_m: float
    tx: float
    ty: float
    tz: float
    row: int
    sheet: int
    offset: int
    margin: float
    px: float
    py: float
    pz: float
    turned: bool
    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float


class PartScalars(ShapeScalars):
    """A shape in a union, in the frame of the first one, and a ball that holds it; `bound_m` < 0: none does."""

    __slots__ = ()

    bound_x: float
    bound_y: float
    bound_z: float
    bound_m: float


class ProxyScalars(ShapeScalars):
    """A proxy and its solid.

    Its state is in the solid's frame: `gx`, `gy`, `gz` the goal, where the proxy would be without friction, or the
    device while free; `ux`, `uy`, `uz` the normal there; `d` the distance that is free around it, or < 0 where the
    device is let be in the solid; `lx`, `ly`, `lz` the device while touching; `left_m` how far the goal might have
    gone on then; `sx`, `sy`, `sz` the proxy itself where there is friction.

    A tick reads, in the world's frame:
        touching: whether the device is held.
        depth_m: from the device to the goal [m].
        normal_x, normal_y, normal_z: the unit vector along that way, outward.
        stretch_x, stretch_y, stretch_z: from the goal to the proxy [m]; 0 without friction.
        sliding: whether friction slips.
        lost_m2: what slipping has taken off half the square of the spring's length in this tick [m^2]; times
            stiffness it is the energy that friction took [J].

    The force of the spring is stiffness times (depth normal + stretch).
    """

    __slots__ = ()

    first_part: int
    end_part: int
    exact: bool
    least_m2: float
    rough: bool
    static_friction: float
    dynamic_friction: float
    reach_x: float
    reach_y: float
    reach_z: float
    reach_w: float
    reach_limit: float
    touching: bool
    sliding: bool
    d: float
    lx: float
    ly: float
    lz: float
    left_m: float
    gx: float
    gy: float
    gz: float
    ux: float
    uy: float
    uz: float
    sx: float
    sy: float
    sz: float
    depth_m: float
    normal_x: float
    normal_y: float
    normal_z: float
    stretch_x: float
    stretch_y: float
    stretch_z: float
    lost_m2: float


PART_KINDS: dict[str, Scalar] = get_type_hints(PartScalars)
PROXY_KINDS: dict[str, Scalar] = get_type_hints(ProxyScalars)
