"""Real-time scheduling: whether the loop gets SCHED_FIFO, and what else bounds it."""

from __future__ import annotations

import os
from pathlib import Path

from hapticd.config.models import LoopConfig
from hapticd.doctor.finding import Finding, advice, ok, problem
from hapticd.doctor.rights import Rights, grant_lines
from hapticd.doctor.tree import ROOT, boot_arguments, kernel_options, read, read_if_there, under

_QUOTA_US = 500_000
_NEEDED_SHARE = 0.5
_SERVICES = "/system.slice"


def priority(loop: LoopConfig, errno: int, root: Path = ROOT) -> Finding:
    """Whether the loop gets its scheduling class.

    Args:
        loop: what it will ask for.
        errno: how a child's attempt went, 0 when it got it.
        root: the file system.
    """
    rights = Rights.of_this_process(root)
    by = "CAP_SYS_NICE" if rights.sys_nice else f"rtprio limit {rights.rtprio:g}"
    if not errno:
        if loop.realtime == "off":
            return advice(
                f'loop.realtime = "off" although {by} grants SCHED_FIFO {loop.priority}: other programs delay the loop',
                '# in the configuration, [loop]: realtime = "preferred"',
            )
        return ok(f"SCHED_FIFO {loop.priority} granted by {by}")
    worse = advice if loop.realtime == "off" else problem
    refused = f"no SCHED_FIFO {loop.priority} ({os.strerror(errno)})"
    if not rights.may_take(loop.priority):
        return worse(f"{refused}: rtprio limit {rights.rtprio:g}, no CAP_SYS_NICE", *grant_lines(loop.priority))
    without = _without_quota(root, _own_group(root))
    if without:
        return worse(
            f"{refused} although {by} allows it: this shell's control group has no real-time quota",
            *_quota_lines(root, without),
        )
    return worse(
        f"{refused} although {by} allows it: a sandbox forbids it",
        "# allow it: RestrictRealtime=no in a unit, --cap-add=sys_nice and no seccomp rule in a container",
    )


def throttling(root: Path = ROOT) -> Finding:
    """How much of the time real-time programs may run in all."""
    runtime_us = int(read(root / "proc/sys/kernel/sched_rt_runtime_us"))
    period_us = int(read(root / "proc/sys/kernel/sched_rt_period_us"))
    if runtime_us < 0:
        return advice(
            "real-time programs may take a processor whole: a loop that never sleeps would freeze the computer",
            "sudo sysctl -w kernel.sched_rt_runtime_us=950000",
        )
    shown = f"real-time programs may run {runtime_us / 1e3:g} of {period_us / 1e3:g} ms"
    if runtime_us < _NEEDED_SHARE * period_us:
        return problem(
            f"{shown}: a loop that computes longer is stopped",
            "sudo sysctl -w kernel.sched_rt_period_us=1000000 kernel.sched_rt_runtime_us=950000",
        )
    return ok(f"{shown}; the loop needs a small part of it")


def quota(root: Path = ROOT, daemon: int = 0) -> Finding:
    """Whether control groups take SCHED_FIFO from a service that has every right to it.

    With CONFIG_RT_GROUP_SCHED a group of the v1 `cpu` controller starts with no real-time quota at all, and then the
    kernel refuses SCHED_FIFO in it even to root.

    Args:
        root: the file system.
        daemon: process of the running daemon, 0 when there is none.
    """
    mount = _mount(root)
    if mount is None or not (mount / "cpu.rt_runtime_us").exists():
        return _without_v1(root)
    groups = {"this shell": _own_group(root)}
    if daemon:
        groups["the running daemon"] = _group(read_if_there(root / f"proc/{daemon}/cgroup"))
    for who, group in groups.items():
        without = _without_quota(root, group)
        if without:
            return problem(
                f"{who} is in the control group {group}, which has no real-time quota (CONFIG_RT_GROUP_SCHED): "
                "SCHED_FIFO is refused there with any rights",
                *_quota_lines(root, without),
                "# it is gone with the group: for a service, see docs/doctor.md",
            )
    without = _without_quota(root, _SERVICES)
    if without:
        return advice(
            f"services run in {_SERVICES}, which has no real-time quota (CONFIG_RT_GROUP_SCHED): SCHED_FIFO may be "
            "refused to the service although root may have it here",
            *_quota_lines(root, without),
            "# then give the unit its own share: docs/doctor.md",
        )
    return ok("CONFIG_RT_GROUP_SCHED, and no group in the way has an empty real-time quota")


def _without_v1(root: Path) -> Finding:
    """What `quota` says where groups are of version 2 or there are none."""
    options, arguments = kernel_options(root), boot_arguments(root)
    off = "CONFIG_RT_GROUP_SCHED_DEFAULT_DISABLED" in options
    grouped = options.get("CONFIG_RT_GROUP_SCHED") == "y" and arguments.get("rt_group_sched", str(int(not off))) != "0"
    if not grouped:
        told = "no CONFIG_RT_GROUP_SCHED" if options else "no real-time quotas"
        return ok(f"{told}: control groups do not stand in the way")
    controllers = read_if_there(root / "sys/fs/cgroup/cgroup.subtree_control").split()
    if "cpu" not in controllers:
        return ok("CONFIG_RT_GROUP_SCHED, but no control group schedules processors")
    return problem(
        "CONFIG_RT_GROUP_SCHED with cgroup v2: SCHED_FIFO is refused in every service with any rights, and "
        "v2 has no quota to give",
        "# start the kernel with rt_group_sched=0 (Linux 6.16 or later), or use one built without it",
    )


def _mount(root: Path) -> Path | None:
    """Where the v1 `cpu` controller is mounted."""
    for line in read_if_there(root / "proc/mounts").splitlines():
        fields = line.split()
        if len(fields) > 3 and fields[2] == "cgroup" and "cpu" in fields[3].split(","):
            return under(root, fields[1])
    return None


def _own_group(root: Path) -> str:
    return _group(read_if_there(root / "proc/self/cgroup"))


def _group(text: str) -> str:
    """The group of the v1 `cpu` controller in what /proc says of a process."""
    for line in text.splitlines():
        _, controllers, path = line.split(":", 2)
        if "cpu" in controllers.split(","):
            return path
    return "/"


def _without_quota(root: Path, group: str) -> list[str]:
    """A group without quota and those above it, the outermost first; none when the group has one."""
    mount = _mount(root)
    if mount is None:
        return []
    path = Path(group)
    chain = [str(part) for part in (*reversed(path.parents), path) if str(part) != "/"]
    empty = [part for part in chain if read_if_there(under(mount, part) / "cpu.rt_runtime_us") == "0"]
    return empty if chain and chain[-1] in empty else []


def _quota_lines(root: Path, groups: list[str]) -> list[str]:
    """Give each group its quota, the outermost first."""
    mount = f"/{(_mount(root) or root).relative_to(root)}"
    return [f"echo {_QUOTA_US} | sudo tee {mount}{group}/cpu.rt_runtime_us" for group in groups]
