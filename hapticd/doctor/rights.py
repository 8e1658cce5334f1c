"""What a process may do: its limits and capabilities, and how a user gets those that a loop needs."""

from __future__ import annotations

import math
import os
import pwd
from dataclasses import dataclass
from pathlib import Path

from hapticd.doctor.tree import ROOT, read

_SYS_NICE = 23
_IPC_LOCK = 14


@dataclass(frozen=True, slots=True)
class Rights:
    """Real-time rights of a process.

    Attributes:
        rtprio: highest real-time priority without a capability.
        memlock: memory that it may lock without a capability [bytes]; inf when unlimited.
        sys_nice: CAP_SYS_NICE is effective.
        ipc_lock: CAP_IPC_LOCK is effective.
    """

    rtprio: float
    memlock: float
    sys_nice: bool
    ipc_lock: bool

    @classmethod
    def of_this_process(cls, root: Path = ROOT) -> Rights:
        """Read the rights of this process.

        Raises:
            OSError: /proc does not tell.
        """
        limits = read(root / "proc/self/limits")
        status = read(root / "proc/self/status")
        capabilities = int(_field(status, "CapEff:"), 16)
        return cls(
            rtprio=_limit(_field(limits, "Max realtime priority")),
            memlock=_limit(_field(limits, "Max locked memory")),
            sys_nice=bool(capabilities >> _SYS_NICE & 1),
            ipc_lock=bool(capabilities >> _IPC_LOCK & 1),
        )

    def may_take(self, priority: int) -> bool:
        """Whether a real-time priority is within these rights."""
        return self.sys_nice or self.rtprio >= priority


def user_name() -> str:
    """Name of the user who runs this."""
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return f"#{os.geteuid()}"


def grant_lines(priority: int) -> tuple[str, ...]:
    """Commands that give a user both rights of a loop."""
    user = user_name()
    return (
        f"printf '{user} - %s\\n' 'rtprio {max(priority, 80)}' 'memlock unlimited' | "
        "sudo tee /etc/security/limits.d/95-hapticd.conf",
        "# then log in again; the system service has its own grants",
    )


def _field(text: str, name: str) -> str:
    for line in text.splitlines():
        if line.startswith(name):
            return line.removeprefix(name).split()[0]
    raise ValueError(f"no {name!r} in /proc")


def _limit(text: str) -> float:
    return math.inf if text == "unlimited" else float(text)
