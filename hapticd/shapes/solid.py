"""Solids: rigid shapes at their places, and the proxy of each that the loop runs."""

from __future__ import annotations

from array import array
from collections.abc import Generator, Hashable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt

from hapticd.errors import ConfigError
from hapticd.shapes.distance import BOX, CAPSULE, CYLINDER, FIELD, PLANE, SPHERE, shape_distance
from hapticd.shapes.field import Field
from hapticd.shapes.pose import Pose, Vector
from hapticd.shapes.scalars import PART_KINDS, PROXY_KINDS, PartScalars, ProxyScalars, Scalar

KINDS = {"plane": PLANE, "sphere": SPHERE, "box": BOX, "capsule": CAPSULE, "cylinder": CYLINDER, "mesh": FIELD}
_NO_VOXELS = array("f")
_FINE_M2, _ROUGH_M2 = 1e-16, 4e-12


@dataclass(frozen=True, slots=True)
class Placed:
    """A shape at its place.

    Attributes:
        shape: one of `KINDS`.
        pose: where it is. A plane is z = 0 of its own frame, solid below; a capsule and a cylinder lie along z.
        inside: whether the device is kept inside, and the solid is all around.
        radius_m: of a sphere, a capsule, a cylinder [m].
        size_m: whole sides of a box [m].
        length_m: of a cylinder from end to end; of a capsule between the centres of its ends [m].
        rounding_m: radius of the edges of a box or a cylinder [m].
        field: the distances of a mesh.

    Raises:
        ConfigError: a size that is missing, too small, or not the shape's.
    """

    shape: str
    pose: Pose
    inside: bool = False
    radius_m: float = 0.0
    size_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length_m: float = 0.0
    rounding_m: float = 0.0
    field: Field | None = None

    def __post_init__(self) -> None:
        if self.shape not in KINDS:
            raise ConfigError(f'shape = "{self.shape}": is none of {", ".join(KINDS)}')
        takes = {
            "plane": (),
            "sphere": ("radius_m",),
            "box": ("size_m",),
            "capsule": ("radius_m", "length_m"),
            "cylinder": ("radius_m", "length_m"),
            "mesh": (),
        }[self.shape]
        for name in ("radius_m", "size_m", "length_m"):
            value = getattr(self, name)
            values = value if isinstance(value, tuple) else (value,)
            if name in takes and not all(0.0 < each < inf for each in values):
                raise ConfigError(f"{name} = {value}: a {self.shape} must have a size above 0")
            if name not in takes and any(each != 0.0 for each in values):
                raise ConfigError(f"{name} = {value}: a {self.shape} has none")
        if (self.field is None) == (self.shape == "mesh"):
            raise ConfigError(
                "a mesh must have a distance field" if self.field is None else f"a {self.shape} has no field"
            )
        if self.rounding_m != 0.0:
            if self.shape not in ("box", "cylinder"):
                raise ConfigError(f"rounding_m = {self.rounding_m}: a {self.shape} has no edges to round")
            most = min(self.size_m) / 2.0 if self.shape == "box" else min(self.radius_m, self.length_m / 2.0)
            if not 0.0 <= self.rounding_m <= most:
                raise ConfigError(f"rounding_m = {self.rounding_m}: must be from 0 to {most:g}, half the least side")

    def fields(self) -> dict[str, float | int | bool]:
        """The scalars by which the arithmetic knows this shape, its pose not among them."""
        r = self.rounding_m
        a = b = c = 0.0
        if self.shape == "box":
            a, b, c = (side / 2.0 - r for side in self.size_m)
        elif self.shape == "cylinder":
            a, b = self.radius_m - r, self.length_m / 2.0 - r
        elif self.shape == "capsule":
            a, b = self.radius_m, self.length_m / 2.0
        else:
            a = self.radius_m
        sign = -1.0 if self.inside else 1.0
        known: dict[str, float | int | bool] = {"kind": KINDS[self.shape], "sign": sign, "a": a, "b": b, "c": c, "r": r}
        return known if self.field is None else known | self.field.scalars()

    @property
    def creases(self) -> bool:
        """Whether it may bend inwards by itself: a mesh, and a room with edges."""
        return self.shape == "mesh" or (self.inside and self.shape in ("box", "cylinder"))

    def centre_m(self) -> Vector:
        """Middle of the balls of `outer_m` and `inner_m`, in the frame around [m]."""
        return self.pose.position_m if self.field is None else self.pose.point(self.field.centre_m)

    def outer_m(self) -> float:
        """Radius of the ball about its centre that holds the shape [m]; endless for a plane."""
        if self.shape == "plane":
            return inf
        if self.field is not None:
            x, y, z = (side - 2.0 * self.field.margin_m for side in self.field.size_m)
            return sqrt(x * x + y * y + z * z) / 2.0
        if self.shape == "box":
            x, y, z = self.size_m
            return sqrt(x * x + y * y + z * z) / 2.0
        if self.shape == "cylinder":
            return sqrt(self.radius_m * self.radius_m + self.length_m * self.length_m / 4.0)
        return self.radius_m + self.length_m / 2.0

    def inner_m(self) -> float:
        """Radius of a ball about its centre that is in the shape all over [m]; 0 when none is known."""
        if self.shape == "box":
            return min(self.size_m) / 2.0
        if self.shape == "cylinder":
            return min(self.radius_m, self.length_m / 2.0)
        return self.radius_m


class Part(PartScalars):
    """A shape in a union, for `hapticd.shapes.surface.distance`."""

    __slots__ = tuple(PART_KINDS)

    def __init__(self, placed: Placed, around: Pose) -> None:
        """Put a shape into the frame of a pose."""
        _fill(self, PART_KINDS, placed, placed.pose.seen_from(around))
        self.bound_x, self.bound_y, self.bound_z = around.own(placed.centre_m())
        outer_m = placed.outer_m()
        self.bound_m = -1.0 if placed.inside or outer_m == inf else outer_m


class Proxy(ProxyScalars):
    """The proxy of one solid, for `hapticd.shapes.proxy.follow` and `place`.

    Args:
        shapes: the shapes of the solid; more than one are its union.
        static_friction: coefficient while it sticks.
        dynamic_friction: coefficient while it slips, at most the static one.
        margin_m: how far the device can move in a tick [m].

    Attributes:
        others: the shapes after the first.
        voxels: the distances of all fields.

    Raises:
        ConfigError: coefficients that are not possible.
    """

    __slots__ = (*PROXY_KINDS, "margin_m", "others", "shapes", "voxels")

    def __init__(
        self,
        shapes: Sequence[Placed],
        static_friction: float = 0.0,
        dynamic_friction: float = 0.0,
        margin_m: float = 0.005,
    ) -> None:
        if not (0.0 <= dynamic_friction <= static_friction and isfinite(static_friction)):
            raise ConfigError(
                f"dynamic_friction = {dynamic_friction}: must be from 0 to static_friction = {static_friction}"
            )
        first = shapes[0]
        self.shapes = tuple(shapes)
        self.margin_m = margin_m
        _fill(self, PROXY_KINDS, first, first.pose)
        self.others = tuple(Part(other, first.pose) for other in shapes[1:])
        self.voxels = _voxels(shapes, (self, *self.others))
        self.first_part = 0
        self.end_part = len(self.others)
        self.exact = not self.others and first.shape != "mesh"
        # A field's normal is off by more than what a slide leaves: sooner done.
        self.least_m2 = _ROUGH_M2 if any(shape.field for shape in shapes) else _FINE_M2
        self.static_friction = static_friction
        self.dynamic_friction = dynamic_friction
        self.rough = static_friction > 0.0
        self.uz = self.normal_z = 1.0
        self._bound(first.pose)

    @property
    def pose(self) -> Pose:
        """Where the first shape is now."""
        return Pose(
            (self.px, self.py, self.pz),
            ((self.xx, self.xy, self.xz), (self.yx, self.yy, self.yz), (self.zx, self.zy, self.zz)),
        )

    def move(self, pose: Pose) -> Vector:
        """Move the solid to another pose of its first shape; the way of the touched material point [m]."""
        own = (self.sx, self.sy, self.sz) if self.rough else (self.gx, self.gy, self.gz)
        x, y, z = self.pose.point(own)
        _put(self, pose)
        self._bound(pose)
        if not self.touching:  # then the trace goes on from where the device was, seen from the solid
            return 0.0, 0.0, 0.0
        to_x, to_y, to_z = pose.point(own)
        return to_x - x, to_y - y, to_z - z

    def _bound(self, pose: Pose) -> None:
        """Set the half space or ball out of which nothing is touched."""
        first = self.shapes[0]
        own = first.pose.own(first.centre_m())
        x, y, z = pose.point(own)
        margin_m = self.margin_m
        self.reach_x = self.reach_y = self.reach_z = self.reach_w = 0.0
        self.reach_limit = inf
        if first.shape == "plane" and not self.others:
            sign = -1.0 if first.inside else 1.0
            self.reach_x, self.reach_y, self.reach_z = (sign * each for each in pose.out((0.0, 0.0, 1.0)))
            self.reach_limit = self.reach_x * x + self.reach_y * y + self.reach_z * z + margin_m
        elif first.inside and not self.others:
            inner_m = max(0.0, first.inner_m() - margin_m)
            self.reach_x, self.reach_y, self.reach_z = 2.0 * x, 2.0 * y, 2.0 * z
            self.reach_w = -1.0
            self.reach_limit = (x * x + y * y + z * z) - inner_m * inner_m
        else:
            outer_m = first.outer_m()
            for part, placed in zip(self.others, self.shapes[1:], strict=True):
                way = (part.bound_x - own[0], part.bound_y - own[1], part.bound_z - own[2])
                far = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
                outer_m = max(outer_m, inf if placed.inside else far + placed.outer_m())
            if first.inside or outer_m == inf:
                return
            outer_m += margin_m
            self.reach_x, self.reach_y, self.reach_z = -2.0 * x, -2.0 * y, -2.0 * z
            self.reach_w = 1.0
            self.reach_limit = outer_m * outer_m - (x * x + y * y + z * z)


def part_distance(proxy: Proxy, at: int, x: float, y: float, z: float) -> float:
    """How far away one shape of a solid is from a point in the frame of the first one, < 0 inside [m].

    Args:
        proxy: of the solid.
        at: which of its `others`; -1: the first shape.
        x: the point, with y and z [m].
        y: see x.
        z: see x.
    """
    shape: Part | Proxy = proxy
    if at >= 0:
        shape = part = proxy.others[at]
        x, y, z = x - part.px, y - part.py, z - part.pz
        if part.turned:
            x, y, z = (
                part.xx * x + part.yx * y + part.zx * z,
                part.xy * x + part.yy * y + part.zy * z,
                part.xz * x + part.yz * y + part.zz * z,
            )
    return shape_distance(shape, proxy.voxels, x, y, z)[0]


def group(shapes: Sequence[Placed], keys: Sequence[Hashable]) -> Generator[None, None, list[list[int]]]:
    """Which shapes make one solid: those of one key that overlap, straight or through others. A step a shape.

    Args:
        shapes: the shapes.
        keys: one a shape; what two must have in common to be one solid.
    """
    groups: list[list[int]] = []
    for at, shape in enumerate(shapes):
        met = [each for each in groups if keys[each[0]] == keys[at] and any(_overlap(shape, shapes[i]) for i in each)]
        groups = [each for each in groups if each not in met]
        groups.append(sorted([at, *(i for each in met for i in each)]))
        yield
    return sorted(groups)


def _overlap(one: Placed, two: Placed) -> bool:
    """Whether two solids may have a point in common; never false where they have."""
    if not (one.inside or two.inside):  # most pairs of a scene are far apart, which their balls tell sooner
        (x, y, z), (u, v, w) = one.centre_m(), two.centre_m()
        far_m = one.outer_m() + two.outer_m()
        if (x - u) * (x - u) + (y - v) * (y - v) + (z - w) * (z - w) > far_m * far_m:
            return False
    return not (_clear(one, two) or _clear(two, one))


def _clear(one: Placed, two: Placed) -> bool:
    """Whether the ball about one of them is off the other."""
    outer_m = inf if one.inside else one.outer_m()
    if outer_m == inf:
        return False
    part = Part(two, two.pose)
    voxels = _NO_VOXELS if two.field is None else two.field.distances_m
    d, _, _, _ = shape_distance(part, voxels, *two.pose.own(one.centre_m()))
    return d >= outer_m + (0.0 if two.field is None else two.field.error_m)


def _voxels(shapes: Sequence[Placed], targets: Sequence[Part | Proxy]) -> array[float]:
    """The distances of all fields, and in each shape where its own begin."""
    fields = [shape.field for shape in shapes if shape.field is not None]
    if len(fields) == 1:
        return fields[0].distances_m
    voxels = array("f")
    for shape, target in zip(shapes, targets, strict=True):
        if shape.field is not None:
            target.offset = len(voxels)
            voxels.extend(shape.field.distances_m)
    return voxels


def _fill(target: Part | Proxy, kinds: dict[str, Scalar], placed: Placed, pose: Pose) -> None:
    for name, kind in kinds.items():
        setattr(target, name, kind(0))
    for name, value in placed.fields().items():
        setattr(target, name, value)
    _put(target, pose)


def _put(target: Part | Proxy, pose: Pose) -> None:
    target.px, target.py, target.pz = pose.position_m
    target.turned = pose.turned
    (
        (target.xx, target.xy, target.xz),
        (target.yx, target.yy, target.yz),
        (target.zx, target.zy, target.zz),
    ) = pose.rotation
