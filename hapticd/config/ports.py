"""What clients may drive in a scene, and how far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hapticd.config.models import SceneConfig
from hapticd.config.objects import HOLD_S, MAX_SPEED_M_PER_S


@dataclass(frozen=True, slots=True)
class PortLimits:
    """One thing in a scene that a client may drive, and how far.

    Attributes:
        name: who it is.
        kind: what it is.
        hold_s: how long an update is good [s].
        stiffness_n_per_m, damping_n_s_per_m: in force until a client says otherwise, and the most it may ask for.
        max_force_n: largest force on the device [N]; 0: an object has no limit but the guard's.
        max_speed_m_per_s: how fast it is followed [m/s]; 0: a force goes nowhere.
    """

    name: str
    kind: Literal["object", "coupling", "force"]
    hold_s: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    max_force_n: float
    max_speed_m_per_s: float


def port_limits(scene: SceneConfig) -> list[PortLimits]:
    """What clients may drive in a scene, in the order of its ports: objects, couplings, forces."""
    return [
        *(
            PortLimits(
                each.name,
                "object",
                HOLD_S if each.hold_s is None else each.hold_s,
                each.stiffness_n_per_m,
                max(0.0, each.damping_n_s_per_m),
                0.0,
                MAX_SPEED_M_PER_S if each.max_speed_m_per_s is None else each.max_speed_m_per_s,
            )
            for each in scene.objects
            if each.remote
        ),
        *(
            PortLimits(
                each.name,
                "coupling",
                each.hold_s,
                each.stiffness_n_per_m,
                each.damping_n_s_per_m,
                each.max_force_n,
                each.max_speed_m_per_s,
            )
            for each in scene.couplings
        ),
        *(PortLimits(each.name, "force", each.hold_s, 0.0, 0.0, each.max_force_n, 0.0) for each in scene.forces),
    ]
