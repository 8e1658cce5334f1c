"""What clients may drive in a scene, and how far."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hapticd.config.objects import HOLD_S, MAX_SPEED_M_PER_S
from hapticd.config.remote import PortLimits

if TYPE_CHECKING:  # the longest way down is one shorter without it
    from hapticd.config.models import SceneConfig

__all__ = ["PortLimits", "port_limits"]


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
                driven=each.driven,
                come_in_s=each.come_in_s,
            )
            for each in scene.couplings
        ),
        *(
            PortLimits(each.name, "force", each.hold_s, 0.0, 0.0, each.max_force_n, 0.0, each.unchanged_s)
            for each in scene.forces
        ),
    ]
