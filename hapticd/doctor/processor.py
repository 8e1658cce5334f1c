"""The processors: what they are, how many, how they save energy, and whose they really are."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

from hapticd.config.models import LoopConfig
from hapticd.doctor.finding import Finding, advice, ok, own_command, problem
from hapticd.doctor.rights import user_name
from hapticd.doctor.tree import ROOT, listed, numbers, read, read_if_there

_STEAL_NOTICED = 0.001
_ORDERED = ("x86_64", "AMD64")
_CPUS = "sys/devices/system/cpu"
_SHALLOW_US = 20


def architecture(machine: str | None = None, largest: int = sys.maxsize) -> Finding:
    """Whether stores stay in order and in one go, which the two processes of the daemon rely on.

    Args:
        machine: name of the architecture; asked for when not given.
        largest: length that this Python can count to, which tells how many bits it has.
    """
    machine = machine or platform.machine()
    if machine not in _ORDERED:
        return problem(
            f"{machine}: the ring between the two processes is safe on 64-bit x86 only, so no daemon starts here",
            "# use a computer with a 64-bit x86 processor",
        )
    if largest < 1 << 32:
        return problem(
            "a Python of 32 bits: it stores a word of the ring in two goes, so the daemon does not start with it",
            "# install hapticd with a 64-bit Python",
        )
    return ok(f"{machine}: stores stay in order, as the shared ring needs it")


def count(loop: LoopConfig, root: Path = ROOT, usable: set[int] | None = None) -> Finding:
    """Whether loop and publisher have a processor each, and whether the one that the loop wants is there.

    Args:
        loop: names the processor, or not.
        root: the file system.
        usable: processors that this process may use; asked for when not given.
    """
    usable = os.sched_getaffinity(0) if usable is None else usable
    online = numbers(read(root / _CPUS / "online"))
    isolated = numbers(read_if_there(root / _CPUS / "isolated"))
    have = f"{len(online)} processor{'s' * (len(online) > 1)}"
    if loop.cpu is not None and loop.cpu not in online:
        wrong = f"loop.cpu = {loop.cpu} is not there: processors {_ranges(online)}"
        return problem(wrong, f"# in the configuration, [loop]: cpu = {max(online)}")
    if isolated and loop.cpu not in isolated:
        return advice(
            f"{have}; {_ranges(isolated)} isolated, but the loop stays off it unless told",
            f"# in the configuration, [loop]: cpu = {max(isolated)}",
        )
    if len(usable | isolated) < 2:
        return advice(
            f"{have}, {len(usable)} usable: loop and publisher share it",
            "# give this computer, container or user a second processor",
        )
    return ok(have + (f"; the loop runs alone on {loop.cpu}, isolated" if isolated else "; none isolated"))


def governor(root: Path = ROOT) -> Finding:
    """Whether the frequency of the processors goes up and down."""
    processors = listed(root / _CPUS)
    if not processors:
        raise FileNotFoundError(2, "No such file or directory", f"/{_CPUS}")
    governors = {read_if_there(cpu / "cpufreq/scaling_governor") for cpu in processors} - {""}
    if not governors:
        return ok("the kernel does not change the frequency here")
    if governors == {"performance"}:
        return ok("performance")
    return advice(
        f"{', '.join(sorted(governors))}: the processor slows down between ticks",
        f"echo performance | sudo tee /{_CPUS}/cpu*/cpufreq/scaling_governor",
    )


def idle(root: Path = ROOT) -> Finding:
    """Whether the loop can keep the processor from sleeping deeply between ticks."""
    deepest_us, name = _deepest_state(root)
    depth = f"deepest {name}, {deepest_us} us to wake" if name else ""
    try:
        os.close(os.open(root / "dev/cpu_dma_latency", os.O_RDWR | os.O_CLOEXEC))
    except OSError as error:
        refused = f"/dev/cpu_dma_latency: {error.strerror}: the processor sleeps deeply between ticks"
        if isinstance(error, FileNotFoundError):
            return advice(
                f"{refused} ({depth})" if depth else refused,
                "# in a container: pass it, --device=/dev/cpu_dma_latency or --bind=/dev/cpu_dma_latency",
            )
        if name and deepest_us <= _SHALLOW_US:
            return ok(f"/dev/cpu_dma_latency: {error.strerror}, but the processor never sleeps deeply ({depth})")
        return advice(
            f"{refused} ({depth})" if depth else refused,
            f"sudo {own_command('service', 'install')}",
            f"sudo usermod -aG hapticd {user_name()}  # then log in again",
        )
    return ok("the loop keeps it out of deep sleep" + (f" ({depth})" if depth else ""))


def virtual(root: Path = ROOT) -> Finding:
    """Whether a host decides when these processors run."""
    stolen = steal(root)
    shown = f", {stolen:.2%} of the time stolen since start" if stolen > _STEAL_NOTICED else ""
    if is_virtual(root):
        maker = read_if_there(root / "sys/class/dmi/id/sys_vendor")
        return advice(
            f"a virtual machine{f' ({maker})' * bool(maker)}: its host decides when the loop runs{shown}",
            "# nothing mends that from inside: run a real device on a computer of its own",
        )
    if shown:
        return advice(f"not marked as a virtual machine, but{shown[1:]}", "# ask who runs the host")
    return ok("a computer of its own")


def is_virtual(root: Path = ROOT) -> bool:
    """Whether the processor says that it is a virtual one.

    Raises:
        OSError: /proc does not tell.
    """
    flags = (line for line in read(root / "proc/cpuinfo").splitlines() if line.startswith("flags"))
    return "hypervisor" in next(flags, "").split()


def steal(root: Path = ROOT) -> float:
    """Share of the processors' time that a host gave to others.

    Raises:
        OSError: /proc does not tell.
    """
    ticks = [int(field) for field in read(root / "proc/stat").splitlines()[0].split()[1:9]]
    total = sum(ticks)
    return ticks[7] / total if len(ticks) > 7 and total else 0.0


def _deepest_state(root: Path) -> tuple[int, str]:
    """How long the deepest sleep takes to leave [us], and its name; 0 and nothing where nothing tells."""
    states = listed(root / _CPUS / "cpu0/cpuidle")
    usable = [state for state in states if read_if_there(state / "disable") == "0"]
    latencies = [(int(read_if_there(state / "latency") or 0), read_if_there(state / "name")) for state in usable]
    return max(latencies, default=(0, ""))


def _ranges(processors: set[int]) -> str:
    """`0-3`, or the processors one by one where there are gaps."""
    ordered = sorted(processors)
    if len(ordered) > 2 and ordered == list(range(ordered[0], ordered[-1] + 1)):
        return f"{ordered[0]}-{ordered[-1]}"
    return ", ".join(map(str, ordered))
