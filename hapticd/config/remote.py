"""[[scene.couplings]] and [[scene.forces]]: what other programs drive, and the limits that they do it under."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from hapticd.settings import Table

MAX_PORTS = 16
"""Most couplings and forces together: the size of a tick record is fixed when the ring is made."""

COME_IN_S = 0.3
"""In which a coupling under the default law comes in unless it says otherwise [s]."""


class CouplingConfig(Table):
    """[[scene.couplings]]: a spring and a damper between the device and a target that a client moves."""

    name: str = Field(min_length=1, max_length=40, description="its name, unique in the scene: clients go by it")
    stiffness_n_per_m: float = Field(
        ge=0.0, le=1e6, description="spring stiffness [N/m]; a client may ask for less, never for more"
    )
    damping_n_s_per_m: float = Field(
        0.0, ge=0.0, le=1e4, description="damping between device and target [N s/m]; a client may ask for less"
    )
    max_force_n: float = Field(
        gt=0.0, le=1e4, description="largest force of it on the device, the law's damping included [N]"
    )
    hold_s: float = Field(
        0.1, gt=0.0, le=10.0, description="how long a target is good; an older one is let go by a ramp [s]"
    )
    max_speed_m_per_s: float = Field(1.0, gt=0.0, le=10.0, description="how fast a target that jumps is followed [m/s]")
    come_in_s: float | None = Field(
        None,
        ge=0.0,
        le=10.0,
        description="in which spring and damper come to what they are whenever they come into force, from nothing: the "
        f"first pull of a stiff spring throws off the body of a late client [s]; unset: {COME_IN_S} under the default "
        "law of [remote], 0 under another; 0: by the ramp alone",
    )
    driven: bool = Field(
        False,
        description="true: the law sees the device against the target and damps between the two, as for a target that "
        "a motor moves and for a hand that moves a tool; false: it sees the device alone and damps it against the "
        "ground, so that what a late client gives back beyond what it got is damped too",
    )


class ForceConfig(Table):
    """[[scene.forces]]: a force that a client sends."""

    name: str = Field(min_length=1, max_length=40, description="its name, unique in the scene: clients go by it")
    max_force_n: float = Field(
        gt=0.0, le=1e4, description="largest force of it on the device, the law's damping included [N]"
    )
    hold_s: float = Field(
        0.05, gt=0.0, le=10.0, description="how long a force is good; an older one is let go by a ramp [s]"
    )
    unchanged_s: float = Field(
        1.0,
        ge=0.0,
        le=3600.0,
        description="how long a force may stay the same, however often it is sent: a client that hangs sends its "
        "last one for ever [s]; 0: as long as it is sent",
    )


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
        unchanged_s: how long a force may stay the same [s]; 0: as long as it is sent.
        driven: whether the law sees the device against the target, and not alone.
        come_in_s: how long spring and damper take to come to what they are [s]; 0: no time of their own; None: what
            its law asks for.
    """

    name: str
    kind: Literal["object", "coupling", "force"]
    hold_s: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    max_force_n: float
    max_speed_m_per_s: float
    unchanged_s: float = 0.0
    driven: bool = False
    come_in_s: float | None = None


def check_ports(objects: Iterable[str], couplings: Sequence[CouplingConfig], forces: Sequence[ForceConfig]) -> None:
    """Refuse names that stand twice, and too many couplings and forces.

    Args:
        objects: the names of the scene's objects.
        couplings: its couplings.
        forces: its forces.

    Raises:
        ValueError: there are such.
    """
    if len(couplings) + len(forces) > MAX_PORTS:
        raise ValueError(
            f"couplings and forces: must be {MAX_PORTS} together at most, not {len(couplings) + len(forces)}"
        )
    seen: dict[str, str] = dict.fromkeys(objects, "an object")
    for kind, names in (
        ("a coupling", [each.name for each in couplings]),
        ("a force", [each.name for each in forces]),
    ):
        for name in names:
            if name in seen:
                raise ValueError(f'{seen[name]} and {kind} have the name "{name}": names are unique in a scene')
            seen[name] = kind
