"""Which contact of `hapticd/damping` is what: walls, objects, couplings and forces, in that order."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd.client import Damping, Status


def count_walls(damping: Damping | None, status: Status) -> int:
    """How many of the contacts are walls."""
    count = len(damping.damping_n_s_per_m) if damping else 0
    return max(0, count - len(status.object_name) - len(_pulling(status)))


def of_objects(damping: Damping | None, status: Status) -> Sequence[float]:
    """Damping of the law on each object [N s/m]."""
    walls = count_walls(damping, status)
    return damping.damping_n_s_per_m[walls : walls + len(status.object_name)] if damping else ()


def of_ports(damping: Damping | None, status: Status) -> list[tuple[str, bool, float]]:
    """Of each coupling and force its name, whether it is in force, and damping of the law [N s/m]."""
    names = _pulling(status)
    if damping is None or not names:
        return []
    count = len(names)
    return list(zip(names, damping.in_contact[-count:], damping.damping_n_s_per_m[-count:], strict=False))


def _pulling(status: Status) -> list[str]:
    """Names of the couplings and forces."""
    kinds = zip(status.remote_name, status.remote_kind, strict=False)
    return [name for name, kind in kinds if kind != "object"]
