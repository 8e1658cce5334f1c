"""A virtual coupling: a spring and a damper between the device and the wall.

Colgate, Stanley & Brown, "Issues in the haptic display of tool use", IROS 1995; Adams & Hannaford, "Stable haptic
interaction with virtual environments", IEEE T-RA 15(3), 1999. What touches the wall is a proxy without mass; the
device feels only the coupling, so that no wall, however stiff, is felt stiffer than the coupling. The wall's own
damping is passed on as it is.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.law import LawParams

LIMIT = 1e12
"""No stiffness [N/m] or position [m] grows beyond this, so that nothing ever overflows."""


class Params(LawParams):
    """The coupling. Passive with any wall and any hand where the device's damping is more than Kc dt / 2 + Bc."""

    coupling_stiffness_n_per_m: float = Field(
        6600.0, gt=0.0, le=1e9, description="spring from device to proxy, Kc; the device is shown k Kc / (k + Kc) [N/m]"
    )
    coupling_damping_n_s_per_m: float = Field(
        1.0, ge=0.0, le=1e9, description="damper from device to proxy, Bc [N s/m]"
    )


class State:
    """Where the proxy is."""

    proxy_m: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """The proxy starts where the device is."""
    state.proxy_m = max(-LIMIT, min(snapshot.x_m, LIMIT))


def step(state: Any, params: Any, tick: Any) -> float:
    """What the wall answers the proxy.  -> force on the device [N]."""
    if not tick.in_contact:
        state.proxy_m = tick.x_m
        return 0.0
    wall_n_per_m = max(0.0, min(-tick.spring_n / tick.x_m, LIMIT))
    spring_n_per_m = params.coupling_stiffness_n_per_m
    damper_n_per_m = params.coupling_damping_n_s_per_m / tick.dt_s
    # -k x_p(n) = Kc (x_p(n) - x(n)) + Bc (v_p(n) - v(n)), both velocities as differences over dt
    pushed_n = spring_n_per_m * tick.x_m + damper_n_per_m * (state.proxy_m + tick.moved_m)
    proxy_m = pushed_n / (wall_n_per_m + spring_n_per_m + damper_n_per_m)
    state.proxy_m = proxy_m
    force_n: float = tick.contact_n - tick.spring_n
    # A wall only pushes: a proxy that the device pulls away from it is free. Along a surface either way is inside.
    if (proxy_m < 0.0) == (tick.x_m < 0.0):
        force_n -= wall_n_per_m * proxy_m
    return force_n
