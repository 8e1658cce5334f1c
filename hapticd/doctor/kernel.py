"""The kernel: how it preempts, and how finely it keeps time."""

from __future__ import annotations

import re
import time
from pathlib import Path

from hapticd.doctor.finding import Finding, advice, ok, problem, unknown
from hapticd.doctor.tree import ROOT, boot_arguments, kernel_options, read, read_if_there

_REALTIME_KERNELS = {
    "debian": "sudo apt install linux-image-rt-amd64",
    "ubuntu": "sudo pro enable realtime-kernel",
    "arch": "sudo pacman -S linux-rt",
}
_SWITCH = "sys/kernel/debug/sched/preempt"
_GOOD_RESOLUTION_S = 1e-6
_SLOW_CLOCKS = ("hpet", "acpi_pm", "jiffies")


def preemption(root: Path = ROOT) -> Finding:
    """Whether the kernel lets the loop in while it does something else."""
    version = read(root / "proc/version")
    if "PREEMPT_RT" in version or read_if_there(root / "sys/kernel/realtime") == "1":
        return ok("PREEMPT_RT: the kernel lets the loop in almost everywhere")
    if "PREEMPT_DYNAMIC" in version:
        return _dynamic(root)
    if re.search(r"\bPREEMPT\b", version):
        return ok("PREEMPT: the kernel lets the loop in outside its critical sections")
    return advice(
        "this kernel is not preemptible: what it does for others can delay the loop by milliseconds",
        _realtime_kernel(root),
        "# then start the computer with it",
    )


def timers(root: Path = ROOT, resolution_s: float | None = None) -> list[Finding]:
    """Whether sleeps end when they should, and whether the time is quick to read.

    Args:
        root: the file system.
        resolution_s: of CLOCK_MONOTONIC [s]; asked for when not given.
    """
    resolution_s = time.clock_getres(time.CLOCK_MONOTONIC) if resolution_s is None else resolution_s
    found = []
    if resolution_s > _GOOD_RESOLUTION_S:
        remedy = "# start the kernel without highres=off, or use one built with CONFIG_HIGH_RES_TIMERS=y"
        found.append(problem(f"timers end in steps of {resolution_s * 1e3:g} ms: no high-resolution timers", remedy))
    sources = root / "sys/devices/system/clocksource/clocksource0"
    source = read_if_there(sources / "current_clocksource")
    if source in _SLOW_CLOCKS:
        remedy = "sudo dmesg | grep -i clocksource  # why the kernel gave up its faster clock"
        if "tsc" in read_if_there(sources / "available_clocksource").split():
            remedy = "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
        found.append(advice(f"the clock is {source}, which takes microseconds to read", remedy))
    if found:
        return found
    return [ok(f"high-resolution, {resolution_s * 1e9:g} ns" + (f", from {source}" if source else ""))]


def _dynamic(root: Path) -> Finding:
    chosen = re.search(r"\((\w+)\)", read_if_there(root / _SWITCH))
    mode = chosen[1] if chosen else boot_arguments(root).get("preempt", "")
    how = "" if chosen else " at start"
    if not mode:
        built = kernel_options(root)
        default = {"": "full", "_LAZY": "lazy", "_VOLUNTARY": "voluntary", "_NONE": "none"}
        mode = next((name for key, name in default.items() if built.get(f"CONFIG_PREEMPT{key}") == "y"), "")
        how = " by default"
    if mode in ("full", "lazy"):
        return ok(f"PREEMPT_DYNAMIC, {mode}{how}: the kernel lets a real-time loop in outside its critical sections")
    if mode not in ("none", "voluntary"):
        return unknown(
            "PREEMPT_DYNAMIC, but its mode is for root only",
            "sudo mount -t debugfs none /sys/kernel/debug",
            f"sudo cat /{_SWITCH}",
        )
    mounted = "/sys/kernel/debug " in read_if_there(root / "proc/mounts")
    return advice(
        f"PREEMPT_DYNAMIC, {mode}{how}: what the kernel does for others can delay the loop by milliseconds",
        *(() if mounted else ("sudo mount -t debugfs none /sys/kernel/debug",)),
        f"echo full | sudo tee /{_SWITCH}",
        "# to keep it: start the kernel with preempt=full",
    )


def _realtime_kernel(root: Path) -> str:
    lines = read_if_there(root / "etc/os-release").splitlines()
    said = dict(line.split("=", 1) for line in lines if "=" in line)
    names = f"{said.get('ID', '')} {said.get('ID_LIKE', '')}".replace('"', "").split()
    known = (_REALTIME_KERNELS[name] for name in names if name in _REALTIME_KERNELS)
    return next(known, "# install the PREEMPT_RT kernel of your distribution")
