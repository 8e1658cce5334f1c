"""What the doctor says of rights that were given, refused, or taken back by a control group."""

from __future__ import annotations

import errno
import gzip
from typing import Literal

import pytest

from hapticd.config.models import LoopConfig
from hapticd.doctor import memory, scheduling
from hapticd.doctor.attempt import attempt
from hapticd.doctor.finding import Check, examine
from tests.doctor.machine import Machine, says

NICE, LOCK = 1 << 23, 1 << 14
LOOP = LoopConfig()


# -- scheduling


def test_the_grant_that_works_is_named(machine: Machine) -> None:
    machine.rights(rtprio="95")
    says(scheduling.priority(LOOP, 0, machine.root), "ok", "FIFO 80", "rtprio limit 95")
    machine.rights(capabilities=NICE)
    says(scheduling.priority(LOOP, 0, machine.root), "ok", "CAP_SYS_NICE")


@pytest.mark.parametrize("rtprio", ["0", "79"])
def test_without_a_grant_the_remedy_writes_one(machine: Machine, rtprio: str) -> None:
    machine.rights(rtprio=rtprio)
    found = says(scheduling.priority(LOOP, errno.EPERM, machine.root), "problem", f"limit {rtprio}", "no CAP_SYS_NICE")
    assert "rtprio 80" in found.mend[0]
    assert "/etc/security/limits.d" in found.mend[0]


def test_a_higher_priority_is_granted_in_full(machine: Machine) -> None:
    machine.rights()
    assert "rtprio 95" in scheduling.priority(LoopConfig(priority=95), errno.EPERM, machine.root).mend[0]


def test_a_loop_that_asks_for_no_real_time_misses_none(machine: Machine) -> None:
    machine.rights()
    says(scheduling.priority(LoopConfig(realtime="off"), errno.EPERM, machine.root), "advice", "no SCHED_FIFO")
    machine.rights(capabilities=NICE)
    says(scheduling.priority(LoopConfig(realtime="off"), 0, machine.root), "advice", 'realtime = "off"')


def test_a_refusal_in_spite_of_every_right_is_a_sandbox(machine: Machine) -> None:
    machine.rights(capabilities=NICE)
    says(scheduling.priority(LOOP, errno.EPERM, machine.root), "problem", "CAP_SYS_NICE allows it", "sandbox")


@pytest.mark.parametrize(
    ("runtime_us", "mark", "word"),
    [
        ("950000", "ok", "950 of 1000 ms"),
        ("-1", "advice", "freeze"),
        ("100000", "problem", "100 of"),
        ("0", "problem", ""),
    ],
)
def test_throttling_leaves_the_loop_enough(machine: Machine, runtime_us: str, mark: str, word: str) -> None:
    machine.file("proc/sys/kernel/sched_rt_runtime_us", runtime_us)
    machine.file("proc/sys/kernel/sched_rt_period_us", "1000000")
    says(scheduling.throttling(machine.root), mark, word)


# -- real-time quotas of control groups


def groups(machine: Machine, own: str, **quotas: str) -> None:
    """The v1 `cpu` controller, with the quota of each group (`a__b` is /a/b)."""
    machine.file("proc/mounts", "cgroup /sys/fs/cgroup/cpu,cpuacct cgroup rw,nosuid,cpu,cpuacct 0 0")
    machine.file("proc/self/cgroup", f"4:memory:/elsewhere\n2:cpu,cpuacct:{own}\n0::/unified")
    machine.file("sys/fs/cgroup/cpu,cpuacct/cpu.rt_runtime_us", "950000")
    for name, quota in quotas.items():
        machine.file(f"sys/fs/cgroup/cpu,cpuacct/{name.replace('__', '/')}/cpu.rt_runtime_us", quota)


def test_fifo_refused_by_an_empty_quota_is_recognised(machine: Machine) -> None:
    """The case in which root is refused what root may have everywhere else."""
    machine.rights(capabilities=NICE)
    groups(machine, "/user/left", user="0", user__left="0")
    found = says(scheduling.priority(LOOP, errno.EPERM, machine.root), "problem", "control group", "no real-time quota")
    assert [line.split()[-1] for line in found.mend] == [
        "/sys/fs/cgroup/cpu,cpuacct/user/cpu.rt_runtime_us",
        "/sys/fs/cgroup/cpu,cpuacct/user/left/cpu.rt_runtime_us",
    ], "a group can only give what it has: the outermost comes first"


def test_a_daemon_in_a_group_without_quota_is_found_from_a_shell_outside(machine: Machine) -> None:
    groups(machine, "/", **{"system.slice": "500000", "system.slice__hapticd.service": "0"})
    machine.file("proc/4711/cgroup", "2:cpu,cpuacct:/system.slice/hapticd.service")
    found = says(scheduling.quota(machine.root, 4711), "problem", "running daemon", "/system.slice/hapticd.service")
    assert found.mend[0].endswith("/system.slice/hapticd.service/cpu.rt_runtime_us")


def test_a_service_that_does_not_run_yet_is_warned(machine: Machine) -> None:
    groups(machine, "/", **{"system.slice": "0"})
    says(scheduling.quota(machine.root), "advice", "/system.slice", "although root may")


def test_own_group_comes_first(machine: Machine) -> None:
    groups(machine, "/user", **{"user": "0", "system.slice": "0"})
    says(scheduling.quota(machine.root), "problem", "this shell", "/user")


def test_groups_with_a_quota_are_well(machine: Machine) -> None:
    groups(machine, "/user", **{"user": "100000", "system.slice": "500000"})
    says(scheduling.quota(machine.root), "ok", "CONFIG_RT_GROUP_SCHED")


@pytest.mark.parametrize(
    ("built", "arguments", "controllers", "mark"),
    [
        ("# CONFIG_RT_GROUP_SCHED is not set\nCONFIG_HZ=250", "quiet", "cpu memory", "ok"),
        ("CONFIG_RT_GROUP_SCHED=y", "quiet", "memory", "ok"),
        ("CONFIG_RT_GROUP_SCHED=y", "quiet rt_group_sched=0", "cpu", "ok"),
        ("CONFIG_RT_GROUP_SCHED=y\nCONFIG_RT_GROUP_SCHED_DEFAULT_DISABLED=y", "quiet", "cpu", "ok"),
        ("CONFIG_RT_GROUP_SCHED=y\nCONFIG_RT_GROUP_SCHED_DEFAULT_DISABLED=y", "rt_group_sched=1", "cpu", "problem"),
        ("CONFIG_RT_GROUP_SCHED=y", "quiet", "cpu memory", "problem"),
    ],
)
def test_version_2_has_no_quota_to_give(
    machine: Machine, built: str, arguments: str, controllers: str, mark: str
) -> None:
    machine.file("proc/config.gz").write_bytes(gzip.compress(f"{built}\n".encode()))
    machine.file("proc/cmdline", arguments)
    machine.file("sys/fs/cgroup/cgroup.subtree_control", controllers)
    machine.file("proc/mounts", "cgroup2 /sys/fs/cgroup cgroup2 rw 0 0")
    says(scheduling.quota(machine.root), mark)


# -- memory


def test_memory_that_may_be_locked_is_well(machine: Machine) -> None:
    machine.rights(capabilities=LOCK)
    says(memory.locking(LOOP, 0, machine.root), "ok", "CAP_IPC_LOCK")
    machine.rights(memlock="unlimited")
    says(memory.locking(LOOP, 0, machine.root), "ok", "without limit")


def test_a_limit_that_is_enough_today_is_named(machine: Machine) -> None:
    machine.rights(memlock=str(512 << 20))
    says(memory.locking(LOOP, 0, machine.root), "advice", "512 MiB")


@pytest.mark.parametrize(("realtime", "mark"), [("preferred", "problem"), ("required", "problem"), ("off", "advice")])
def test_memory_that_may_not_be_locked_is_granted(
    machine: Machine, realtime: Literal["required", "preferred", "off"], mark: str
) -> None:
    machine.rights()
    found = says(memory.locking(LoopConfig(realtime=realtime), errno.ENOMEM, machine.root), mark, "8 MiB")
    assert "memlock unlimited" in found.mend[0]


def test_swap_only_matters_to_memory_that_is_not_locked(machine: Machine) -> None:
    head = "Filename\tType\tSize\tUsed\tPriority"
    machine.file("proc/swaps", head)
    says(memory.swap(errno.ENOMEM, machine.root), "ok", "none")
    machine.file("proc/swaps", f"{head}\n/dev/sda2 partition 1 0 -2")
    says(memory.swap(0, machine.root), "ok", "/dev/sda2")
    assert says(memory.swap(errno.ENOMEM, machine.root), "advice", "/dev/sda2").mend == ("sudo swapoff -a",)


@pytest.mark.parametrize("text", ["", "Max realtime priority", "Max realtime priority many many"])
def test_limits_that_cannot_be_read_are_not_guessed(machine: Machine, text: str) -> None:
    machine.rights()
    machine.file("proc/self/limits", text)
    (found,) = examine(Check("a.check", "check", lambda: scheduling.priority(LOOP, 0, machine.root)))
    says(found, "unknown", "could not tell")


def test_a_child_tries_what_the_loop_will_do() -> None:
    """Priority 0 is none that SCHED_FIFO has, for nobody."""
    assert attempt(0).scheduling == errno.EINVAL
