"""Solids: the objects of a scene, compiled for the tick. Objects that overlap and are alike on the surface are one."""

from __future__ import annotations

import zlib
from collections.abc import Generator, Iterable, Sequence
from copy import copy
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any, TypeVar

from hapticd.config.objects import (
    MAX_SPEED_M_PER_S,
    BoxObject,
    CapsuleObject,
    CylinderObject,
    MeshObject,
    ObjectConfig,
    SphereObject,
)
from hapticd.errors import ConfigError
from hapticd.shapes.field import Field
from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Placed, Proxy, group, part_distance

T = TypeVar("T")

FASTEST_M_PER_S = 5.0
"""A device that is faster may be inside a thin object before it is looked for [m/s]."""

FARTHEST_M = 1e3
"""No device is as deep in anything [m]."""

_SURFACE = ("stiffness_n_per_m", "damping_n_s_per_m", "static_friction", "dynamic_friction")


class Solid:
    """One solid, ready for the tick.

        F = k (s - p) - b (u . v) u        p the device, s its proxy on the surface, u the normal there

    Args:
        configs: its objects, the first of which gives it its name.
        members: indices of its objects in the scene.
        period_s: time between ticks [s].

    Attributes:
        name: who it is through a reload.
        members: indices of its objects in the scene.
        index: of the first of them.
        configs: what the tables say.
        placed: the shapes at their places.
        proxy: the point on its surface that pulls the device back; it keeps its own state.
        stiffness_n_per_m, damping_n_s_per_m: in force now.
        rough: whether it has friction.
        creases: whether it may bend inwards, so that its proxy is pinned somewhere.
        remote: whether a client moves it.

    Raises:
        ConfigError: a shape that is not possible.
    """

    __slots__ = (
        "configs",
        "creases",
        "damping_n_s_per_m",
        "index",
        "members",
        "name",
        "placed",
        "proxy",
        "remote",
        "rough",
        "stiffness_n_per_m",
    )

    def __init__(self, configs: Sequence[ObjectConfig], members: Sequence[int], period_s: float) -> None:
        first = configs[0]
        self.name = first.name
        self.members = tuple(members)
        self.index = members[0]
        self.configs = tuple(configs)
        self.placed = [placed(config) for config in configs]
        self.remote = first.remote
        fastest_m_per_s = FASTEST_M_PER_S
        if first.remote:
            fastest_m_per_s += MAX_SPEED_M_PER_S if first.max_speed_m_per_s is None else first.max_speed_m_per_s
        margin_m = fastest_m_per_s * period_s
        self.proxy = Proxy(self.placed, first.static_friction, first.dynamic_friction, margin_m)
        self.stiffness_n_per_m = first.stiffness_n_per_m
        self.damping_n_s_per_m = first.damping_n_s_per_m
        self.rough = first.static_friction > 0.0
        self.creases = len(self.placed) > 1 or any(each.creases for each in self.placed)

    @property
    def place(self) -> str:
        """Where it is in the file, and its name."""
        return f'scene.objects[{self.index}] "{self.name}"'

    def stored_j(self, stretch_m: float, limit_n: float) -> float:
        """Energy in the spring [J]: k s^2 / 2, and force times length where the guard's limit flattens it.

        Args:
            stretch_m: from the device to its proxy, >= 0 [m].
            limit_n: largest force that the guard lets through [N].
        """
        spring_n = self.stiffness_n_per_m * stretch_m
        if spring_n <= limit_n:
            return 0.5 * spring_n * stretch_m
        return limit_n * (stretch_m - 0.5 * limit_n / self.stiffness_n_per_m)

    def shares(self, x: float, y: float, z: float) -> tuple[int, int]:
        """Which of its objects carries the force, and a bit each for those that the device is in.

        Args:
            x: the device in the world, with y and z [m].
            y: see x.
            z: see x.
        """
        proxy = self.proxy
        pose = proxy.pose
        held = (proxy.sx, proxy.sy, proxy.sz) if proxy.rough else (proxy.gx, proxy.gy, proxy.gz)
        device = pose.own((x, y, z))
        least_m = inf
        carrier, inside = self.index, 0
        for at, index in enumerate(self.members):
            away_m = part_distance(proxy, at - 1, *held)
            if away_m < least_m:
                least_m = away_m
                carrier = index
            if part_distance(proxy, at - 1, *device) < 0.0:
                inside |= 1 << index
        return carrier, inside

    def same_as(self, other: Solid) -> bool:
        """Whether the tables of the two say the same, and their files hold the same."""
        return self.configs == other.configs and self._same_fields(other)

    def inherit(self, other: Solid) -> bool:
        """Take the proxy over from a solid of the same name, where this one has moved but is the same shape.

        Of several objects the first must not have moved: seen from there, the others have. Nor may the side on which
        the proxy is have been turned away from the device.

        Returns:
            Whether it was; else the proxy must be found anew, where a client moves it at the place to which it has.
        """
        moved = self.placed[0].pose != other.placed[0].pose
        same_shape = _without_place(self.configs) == _without_place(other.configs) and self._same_fields(other)
        if not same_shape or (moved and len(self.placed) > 1):
            if not moved and self.remote:  # it is where its client has it
                self.proxy.move(other.proxy.pose)
            return False
        self.proxy = copy(other.proxy)
        if moved:
            self.proxy.move(self.placed[0].pose)
            u = (self.proxy.ux, self.proxy.uy, self.proxy.uz)
            return sum(a * b for a, b in zip(self.proxy.pose.out(u), other.proxy.pose.out(u), strict=True)) > 0.0
        return True

    def _same_fields(self, other: Solid) -> bool:
        """Whether meshes are as they were read before; where the tables are alike."""
        return all(mine.field is its.field for mine, its in zip(self.placed, other.placed, strict=True))

    def let_go(self) -> None:
        """Be gone: without force from now on."""
        self.stiffness_n_per_m = self.damping_n_s_per_m = 0.0


def astray(solids: Iterable[Solid]) -> str:
    """Which of them has a surface that is further away than `FARTHEST_M`, for people."""
    for solid in solids:
        if not solid.proxy.depth_m < FARTHEST_M:
            return f"{solid.place}: its surface is {solid.proxy.depth_m:.3g} m away, which is not possible"
    return "scene.objects: where the surface is cannot be told"


def placed(config: ObjectConfig) -> Placed:
    """The shape of an object at its place.

    Raises:
        ConfigError: a size or a file that is not possible.
    """
    keys: dict[str, Any] = {"pose": Pose.of(config.position_m, config.orientation), "inside": config.inside}
    match config:
        case SphereObject():
            keys |= {"radius_m": config.radius_m}
        case BoxObject():
            keys |= {"size_m": config.size_m, "rounding_m": config.rounding_m}
        case CapsuleObject():
            keys |= {"radius_m": config.radius_m, "length_m": config.length_m}
        case CylinderObject():
            keys |= {"radius_m": config.radius_m, "length_m": config.length_m, "rounding_m": config.rounding_m}
        case MeshObject():
            keys |= {"field": field_of(Path(config.file))}
        case _:
            pass
    return Placed(config.shape, **keys)


def field_of(file: Path) -> Field:
    """The distance field of a mesh; read once for as long as the file does not change.

    Raises:
        ConfigError: it cannot be read, or is none.
    """
    try:
        seen = file.stat()
    except OSError as error:
        raise ConfigError(f"file = {file}: {error.strerror}; `hapticd mesh` makes it from an STL or OBJ file") from None
    return _field(file, seen.st_mtime_ns, seen.st_size)


def fields_of(objects: Iterable[ObjectConfig]) -> int:
    """A number that other fields of a scene's meshes differ in; of those that are loaded, not of what was edited since.

    Raises:
        ConfigError: a file cannot be read, or is none.
    """
    checks = [field_of(Path(each.file)).check for each in objects if isinstance(each, MeshObject)]
    return zlib.crc32(repr(checks).encode()) if checks else 0


@lru_cache(maxsize=64)
def _field(file: Path, _changed_ns: int, _size: int) -> Field:
    try:
        return Field.unpack(file.read_bytes())
    except OSError as error:
        raise ConfigError(f"file = {file}: {error.strerror}") from None
    except ConfigError as error:
        raise ConfigError(f"file = {file}: {error}") from None


def at_once(steps: Generator[None, None, T]) -> T:
    """What comes of steps, for which nothing else has to wait."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            done: T = end.value
            return done


def compile_objects(objects: Sequence[ObjectConfig], period_s: float) -> Generator[None, None, list[Solid]]:
    """The solids of a scene, in the order of their first objects. No step does more than an object needs.

    Raises:
        ConfigError: a shape that is not possible.
    """
    shapes = []
    for index, config in enumerate(objects):
        try:
            shapes.append(placed(config))
        except ConfigError as error:
            raise ConfigError(f'scene.objects[{index}] "{config.name}": {error}') from None
        yield
    # What a client moves is no part of another solid.
    surfaces = [
        (*(getattr(config, key) for key in _SURFACE), config.name if config.remote else "") for config in objects
    ]
    groups = yield from group(shapes, surfaces)
    solids = []
    for members in sorted(groups, key=lambda members: members[0]):
        solids.append(Solid([objects[at] for at in members], members, period_s))
        yield
    return solids


def _without_place(configs: Sequence[ObjectConfig]) -> list[dict[str, Any]]:
    """What tables say but for the place of the first: of the others it counts, as they are seen from there."""
    skip = (
        *("position_m", "orientation", "stiffness_n_per_m", "damping_n_s_per_m"),
        *("hold_s", "max_speed_m_per_s"),
    )
    return [
        {key: value for key, value in config.__dict__.items() if at > 0 or key not in skip}
        for at, config in enumerate(configs)
    ]
