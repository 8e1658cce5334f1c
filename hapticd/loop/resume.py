"""What a loop leaves behind for the one that goes on with the device once it is found again."""

from __future__ import annotations

from dataclasses import dataclass, field

from hapticd.device import DeviceInfo
from hapticd.loop.memory import (
    DISARM,
    DISARMED,
    FIELDS,
    LATCHED,
    LAW,
    LAW_CODE,
    MAY_ARM,
    NEXT_SEQ,
    PORT_LAW_CODE,
    SKIPPED,
    SharedMemory,
)


@dataclass(frozen=True, slots=True)
class ResumeState:
    """Where the loop before stopped; of the first one, nothing.

    Attributes:
        seq: number of the next tick; subscribers see no step back.
        skipped: deadlines skipped so far.
        law: index of the law activation.
        may_arm: forces were let through when it ended; a device that arms by itself may do so again.
        latched: a fault that took the force away has not been cleared.
        device: `identity` of the device; no other one may take its place. "": any.
        law_code: `plugins.code_of` its law; 0: any.
        port_law_code: and of the law that couplings and forces are under.
        fields: `fields_of` its scene; 0: any.
    """

    seq: int = 0
    skipped: int = 0
    law: int = 0
    may_arm: bool = True
    latched: bool = False
    device: str = ""
    law_code: int = field(default=0, repr=False)
    port_law_code: int = field(default=0, repr=False)
    fields: int = field(default=0, repr=False)


FROM_START = ResumeState()
"""What the first loop goes on from."""


def left_by(shared: SharedMemory, info: DeviceInfo) -> ResumeState:
    """What a loop has left; one that was still to disarm leaves a device that stays disarmed.

    Args:
        shared: its memory.
        info: its device.
    """
    words = shared.words
    return ResumeState(
        seq=words[NEXT_SEQ],
        skipped=words[SKIPPED],
        law=words[LAW],
        may_arm=bool(words[MAY_ARM]) and words[DISARM] == words[DISARMED],
        latched=bool(words[LATCHED]),
        device=identity(info),
        law_code=words[LAW_CODE],
        port_law_code=words[PORT_LAW_CODE],
        fields=words[FIELDS],
    )


def identity(info: DeviceInfo) -> str:
    """What tells a device from another, and what subscribers were told of it."""
    extras = [f"{info.buttons} buttons"] if info.buttons else []
    extras += [name for name in ("gripper", "orientation") if getattr(info, f"has_{name}")]
    return " ".join([info.model, info.serial, f"({', '.join([''.join(info.axes), *extras])})"]).replace("  ", " ")
