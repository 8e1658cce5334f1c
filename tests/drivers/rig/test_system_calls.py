"""A healthy tick on a rig asks the system for its sleep, and to read and write the rig: nothing else."""

from __future__ import annotations

import ctypes
from collections import Counter
from pathlib import Path

import pytest

from tests.drivers.rig.device import Rig
from tests.drivers.rig.hid_bench import HidDouble, build
from tests.loop.system_calls import UNHURRIED, system_calls

TICKS = 300
LOOP = {"clock_nanosleep", "clock_gettime"}
"""The sleep, and after a tick that was late how long it has computed."""

CONFIG = """
[device]
driver = "{driver}"
[device.options]
sign_checked = true
{options}
[[scene.walls]]
stiffness_n_per_m = 500.0
[safety]
auto_arm = true
"""


@pytest.mark.nightly  # a rig that a busy computer keeps from answering is lost
def test_a_tick_on_a_serial_line_reads_and_writes_the_line(rig_core: ctypes.CDLL, tmp_path: Path) -> None:
    """One write and one read a tick, and looks whether something has come: more where the state is still under way."""
    with Rig(rig_core, tmp_path / "port", pace="real") as rig:
        rig.set_home()
        config = UNHURRIED + CONFIG.format(driver="serial-rig", options=f'port = "{rig.port}"')
        found = system_calls(config, TICKS, tmp_path, {})
    line = [(name, arguments) for name, arguments in found if name not in LOOP]
    assert all("</dev/pts/" in arguments for _, arguments in line)
    counts = Counter(name for name, _ in line)
    assert set(counts) <= {"write", "read", "ioctl"}, counts
    assert counts["write"] <= TICKS
    assert counts["read"] <= TICKS + 1
    assert counts["read"] <= counts["ioctl"] <= 8 * TICKS


@pytest.mark.nightly
def test_a_tick_on_usb_reads_the_rig_and_wakes_the_thread_that_writes(tmp_path: Path) -> None:
    """What the double's preload library asks for besides, on each read and to its program, is not the driver's."""
    double = HidDouble(build(tmp_path))
    try:
        config = UNHURRIED + CONFIG.format(driver="hid-rig", options="")
        found = system_calls(config, TICKS, tmp_path, double.environment)
    finally:
        double.close()
    own = {name for name, _ in found} - LOOP - {"rt_sigprocmask", "sendto", "recvfrom"}
    assert own == {"poll", "read", "futex", "sched_getscheduler"}
    assert all("/dev/" in arguments for name, arguments in found if name in ("poll", "read"))
