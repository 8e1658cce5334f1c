"""Memory: whether the loop may lock its own, and whether there is swap that it would have to wait for."""

from __future__ import annotations

import math
import os
from pathlib import Path

from hapticd.config.models import LoopConfig
from hapticd.doctor.finding import Finding, advice, ok, problem
from hapticd.doctor.rights import Rights, grant_lines
from hapticd.doctor.tree import ROOT, read


def locking(loop: LoopConfig, errno: int, root: Path = ROOT) -> Finding:
    """Whether the loop may lock its memory.

    Args:
        loop: what it will ask for.
        errno: how a child's attempt went, 0 when it could.
        root: the file system.
    """
    rights = Rights.of_this_process(root)
    limit = "unlimited" if math.isinf(rights.memlock) else f"{rights.memlock / 2**20:.3g} MiB"
    if errno:
        worse = advice if loop.realtime == "off" else problem
        return worse(
            f"memory is not locked ({os.strerror(errno)}): memlock limit {limit}, no CAP_IPC_LOCK",
            *grant_lines(loop.priority),
        )
    if rights.ipc_lock:
        return ok("memory can be locked, granted by CAP_IPC_LOCK")
    if math.isinf(rights.memlock):
        return ok("memory can be locked, without limit")
    return advice(
        f"memory can be locked, but only {limit}: a driver's library may need more", *grant_lines(loop.priority)
    )


def swap(errno: int, root: Path = ROOT) -> Finding:
    """Whether the loop may have to wait for a disk to get its memory back.

    Args:
        errno: whether its memory can be locked, 0 when so.
        root: the file system.
    """
    lines = read(root / "proc/swaps").splitlines()[1:]
    if not lines:
        return ok("none")
    names = ", ".join(line.split()[0] for line in lines)
    if not errno:
        return ok(f"on {names}; locked memory stays out of it")
    return advice(f"on {names}, and memory is not locked: the loop may wait for a disk", "sudo swapoff -a")
