"""What the doctor says of kernels and processors that other people have."""

from __future__ import annotations

import gzip

import pytest

from hapticd.config.models import LoopConfig
from hapticd.doctor import kernel, processor
from hapticd.doctor.finding import Check, examine
from tests.doctor.machine import Machine, says

CPU = "sys/devices/system/cpu"
LATENCY = "dev/cpu_dma_latency"

# -- kernel


def version(machine: Machine, flags: str) -> None:
    machine.file("proc/version", f"Linux version 6.8.0 (gcc 13) #1 SMP {flags} Thu Jan 1 2026")


@pytest.mark.parametrize("flags", ["PREEMPT_RT", "PREEMPT"])
def test_a_preemptible_kernel_is_well(machine: Machine, flags: str) -> None:
    version(machine, flags)
    says(kernel.preemption(machine.root), "ok", flags)


@pytest.mark.parametrize(("distribution", "command"), [("debian", "apt install"), ("ubuntu", "pro enable")])
def test_a_server_kernel_is_replaced_in_the_way_of_its_distribution(
    machine: Machine, distribution: str, command: str
) -> None:
    version(machine, "")
    machine.file("etc/os-release", f'PRETTY_NAME="Some Linux"\nID={distribution}')
    assert command in says(kernel.preemption(machine.root), "advice", "not preemptible").mend[0]


def test_on_an_unknown_distribution_the_remedy_is_a_comment(machine: Machine) -> None:
    version(machine, "")
    assert says(kernel.preemption(machine.root), "advice").mend[0].startswith("# ")


@pytest.mark.parametrize(
    ("mode", "mark"), [("full", "ok"), ("lazy", "ok"), ("voluntary", "advice"), ("none", "advice")]
)
def test_a_dynamic_kernel_is_as_good_as_its_mode(machine: Machine, mode: str, mark: str) -> None:
    """Lazy preemption delays ordinary tasks only, never real-time ones."""
    version(machine, "PREEMPT_DYNAMIC")
    shown = "none voluntary full lazy".replace(mode, f"({mode})")
    machine.file("sys/kernel/debug/sched/preempt", shown)
    machine.file("proc/cmdline", "quiet preempt=none")
    says(kernel.preemption(machine.root), mark, f"{mode}:")


def test_without_debugfs_the_boot_argument_tells_the_mode(machine: Machine) -> None:
    version(machine, "PREEMPT_DYNAMIC")
    machine.file("proc/cmdline", "quiet preempt=full -- preempt=none")
    says(kernel.preemption(machine.root), "ok", "full at start")


@pytest.mark.parametrize(("built", "mark"), [("CONFIG_PREEMPT=y", "ok"), ("CONFIG_PREEMPT_NONE=y", "advice")])
def test_without_a_boot_argument_the_build_tells_it(machine: Machine, built: str, mark: str) -> None:
    version(machine, "PREEMPT_DYNAMIC")
    machine.file("proc/config.gz").write_bytes(gzip.compress(f"{built}\nCONFIG_PREEMPT_DYNAMIC=y\n".encode()))
    says(kernel.preemption(machine.root), mark, "by default")


def test_debugfs_is_mounted_first_where_it_is_not(machine: Machine) -> None:
    version(machine, "PREEMPT_DYNAMIC")
    machine.file("proc/cmdline", "preempt=voluntary")
    assert "mount -t debugfs" in kernel.preemption(machine.root).mend[0]
    machine.file("proc/mounts", "debugfs /sys/kernel/debug debugfs rw 0 0")
    assert "mount" not in kernel.preemption(machine.root).mend[0]


def test_a_mode_that_only_root_may_read_is_not_guessed(machine: Machine) -> None:
    version(machine, "PREEMPT_DYNAMIC")
    says(kernel.preemption(machine.root), "unknown", "for root only")


def test_timers_of_a_jiffy_are_no_timers_for_a_loop(machine: Machine) -> None:
    says(kernel.timers(machine.root, 0.004), "problem", "4 ms")
    says(kernel.timers(machine.root, 1e-9), "ok", "1 ns")


@pytest.mark.parametrize(("available", "command"), [("hpet acpi_pm", "dmesg"), ("tsc hpet", "echo tsc")])
def test_a_slow_clock_is_changed_where_there_is_a_faster_one(machine: Machine, available: str, command: str) -> None:
    sources = "sys/devices/system/clocksource/clocksource0"
    machine.file(f"{sources}/current_clocksource", "hpet")
    machine.file(f"{sources}/available_clocksource", available)
    assert command in says(kernel.timers(machine.root, 1e-9), "advice", "hpet").mend[0]


# -- processor


def test_only_processors_that_keep_stores_in_order_run_the_daemon() -> None:
    """C14."""
    says(processor.architecture("x86_64"), "ok")
    for machine in ("aarch64", "i686"):
        says(processor.architecture(machine), "problem", machine)
    says(processor.architecture("x86_64", 2**31 - 1), "problem", "a Python of 32 bits")


def test_a_processor_that_is_not_there_cannot_be_chosen(machine: Machine) -> None:
    machine.file(f"{CPU}/online", "0-3")
    found = says(processor.count(LoopConfig(cpu=4), machine.root, {0, 1, 2, 3}), "problem", "loop.cpu = 4", "0-3")
    assert "cpu = 3" in found.mend[0]


def test_an_isolated_processor_stays_unused_unless_the_loop_is_told(machine: Machine) -> None:
    """Isolation takes a processor out of every default affinity, so the loop's default is never that one."""
    machine.file(f"{CPU}/online", "0-3")
    machine.file(f"{CPU}/isolated", "2-3")
    says(processor.count(LoopConfig(), machine.root, {0, 1}), "advice", "2, 3 isolated")
    says(processor.count(LoopConfig(cpu=3), machine.root, {0, 1}), "ok", "alone on 3")


def test_one_processor_is_too_few(machine: Machine) -> None:
    machine.file(f"{CPU}/online", "0-7")
    says(processor.count(LoopConfig(), machine.root, {5}), "advice", "1 usable")
    says(processor.count(LoopConfig(), machine.root, {4, 5}), "ok", "8 processors")


def test_a_governor_that_saves_energy_costs_time(machine: Machine) -> None:
    machine.file(f"{CPU}/cpu0/cpufreq/scaling_governor", "performance")
    says(processor.governor(machine.root), "ok", "performance")
    machine.file(f"{CPU}/cpu1/cpufreq/scaling_governor", "powersave")
    assert "tee" in says(processor.governor(machine.root), "advice", "powersave").mend[0]


def test_a_guest_without_governors_is_well(machine: Machine) -> None:
    machine.file(f"{CPU}/online", "0")
    says(processor.governor(machine.root), "ok")


def state(machine: Machine, number: int, name: str, latency_us: int, disabled: bool = False) -> None:
    for attribute, value in {"name": name, "latency": latency_us, "disable": int(disabled)}.items():
        machine.file(f"{CPU}/cpu0/cpuidle/state{number}/{attribute}", str(value))


def test_a_latency_file_that_opens_keeps_deep_sleep_away(machine: Machine) -> None:
    state(machine, 0, "C1", 2)
    state(machine, 1, "C10", 890)
    machine.file(LATENCY)
    says(processor.idle(machine.root), "ok", "C10, 890 us")


def test_a_latency_file_that_is_missing_is_passed_to_the_container(machine: Machine) -> None:
    assert "container" in says(processor.idle(machine.root), "advice", "No such file").mend[0]


def test_a_latency_file_that_does_not_open_is_granted_by_the_rule(machine: Machine) -> None:
    (machine.root / LATENCY).mkdir(parents=True)
    found = says(processor.idle(machine.root), "advice", LATENCY)
    assert "service install" in found.mend[0]
    assert "usermod -aG hapticd" in found.mend[1]


def test_a_processor_that_never_sleeps_deeply_needs_no_hold(machine: Machine) -> None:
    (machine.root / LATENCY).mkdir(parents=True)
    state(machine, 0, "POLL", 0)
    state(machine, 1, "C1", 2)
    state(machine, 2, "C6", 133, disabled=True)
    says(processor.idle(machine.root), "ok", "C1, 2 us")


def test_a_guest_is_told_from_a_computer_of_its_own(machine: Machine) -> None:
    machine.file("proc/stat", "cpu  900 0 50 9000 0 0 0 0 0 0\ncpu0 1 1")
    machine.file("proc/cpuinfo", "model name : x\nflags\t\t: fpu tsc")
    says(processor.virtual(machine.root), "ok")
    machine.file("proc/cpuinfo", "model name : x\nflags\t\t: fpu hypervisor tsc")
    machine.file("sys/class/dmi/id/sys_vendor", "QEMU")
    says(processor.virtual(machine.root), "advice", "QEMU")


def test_stolen_time_is_said_of_guest_and_of_others(machine: Machine) -> None:
    machine.file("proc/stat", "cpu  500 0 50 9000 0 0 0 450 0 0")
    machine.file("proc/cpuinfo", "flags : fpu hypervisor")
    says(processor.virtual(machine.root), "advice", "virtual", "4.50%")
    machine.file("proc/cpuinfo", "flags : fpu")
    says(processor.virtual(machine.root), "advice", "not marked", "4.50%")


# -- nothing to look at


@pytest.mark.parametrize(
    "look",
    [kernel.preemption, processor.governor, processor.virtual, lambda root: processor.count(LoopConfig(), root, {0})],
)
def test_on_a_computer_without_proc_and_sys_a_check_cannot_tell(machine: Machine, look: object) -> None:
    assert callable(look)
    (found,) = examine(Check("a.check", "check", lambda: look(machine.root)))
    says(found, "unknown", "could not tell", "No such file")


def test_nonsense_from_the_kernel_is_no_traceback(machine: Machine) -> None:
    machine.file("proc/stat", "cpu one two")
    (found,) = examine(Check("a.check", "check", lambda: processor.virtual(machine.root)))
    says(found, "unknown", "ValueError")
