"""The bound of the service's memory under a real systemd: clients come nowhere near it, and beyond it force ends."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from hapticd.tick.event import EventCode
from tests.daemon.running import Subscriber, gone
from tests.daemon.test_deaths import PRESSED
from tests.daemon.test_flood import flood
from tests.daemon.test_out_of_memory import LEAKING_LAW
from tests.service.machine import Machine, eventually
from tests.service.unit import Service

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(1800)]

SHARE = 0.5
"""Of the bound, what all processes of the service may take while clients do their worst."""

LEAKING = PRESSED + '[controller]\nlaw = "leaking_lab.leaking"\n[loop]\nlaw_budget = 1.0\n'


def peak_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024.0


def bound_bytes(service: Service) -> int:
    """As systemd has read it."""
    return int(service.show("MemoryMax"))


@contextlib.contextmanager
def group_of(service: Service) -> Iterator[None]:
    """The service's processes within its bound: as systemd does it, or in its place.

    The systemd of a machine in a machine has no controller of memory where the kernel still has the old ones.
    """
    if service.show("MemoryCurrent") != "[not set]":
        yield
        return
    old, new = Path("/sys/fs/cgroup/memory"), Path("/sys/fs/cgroup")
    group, limit = (old, "memory.limit_in_bytes") if old.is_dir() else (new, "memory.max")
    group /= "hapticd-service-test"
    try:
        group.mkdir()
        (group / limit).write_text(str(bound_bytes(service)))
    except OSError as error:
        with contextlib.suppress(OSError):
            group.rmdir()
        pytest.skip(f"no group of processes with a memory bound can be made here: {error}")
    try:
        for pid in (service.supervisor, service.control):
            (group / "cgroup.procs").write_text(str(pid))
        yield
    finally:
        eventually(lambda: not (group / "cgroup.procs").read_text(), "the end of its processes", service.machine)
        group.rmdir()


def test_what_clients_do_takes_no_more_than_half_of_the_bound(service: Service) -> None:
    """All at once: connections that say nothing, and subscriptions to what there is not."""
    bound_mb = bound_bytes(service) / (1 << 20)
    with Subscriber(service.endpoint, "hapticd/event") as rude:
        rude.socket.setsockopt(zmq.SNDHWM, 0)
        with flood(service.endpoint.removeprefix("ipc://"), 1500):
            for number in range(20_000):
                rude.socket.setsockopt(zmq.SUBSCRIBE, f"{number:06d}".encode() + b"x" * 994)
            with Subscriber(service.endpoint, "hapticd/status") as polite:  # served after those that came before it
                polite.until("hapticd/status")
            service.machine.run("hapticd", "disarm")
            time.sleep(2.0)
    taken_mb = peak_mb(service.supervisor) + peak_mb(service.control)
    sys.stdout.write(f"{taken_mb:.0f} of {bound_mb:.0f} MB\n")
    assert taken_mb < SHARE * bound_mb
    assert service.machine.processes(service.unit) == (service.supervisor, service.control)


def test_beyond_the_bound_the_force_ends_and_systemd_starts_it_again(machine: Machine) -> None:
    packages = next(machine.path("/opt/hapticd/lib").glob("python3*")) / "site-packages"
    (packages / "leaking_lab").mkdir()
    (packages / "leaking_lab/leaking.py").write_text(LEAKING_LAW)
    topics = ("hapticd/event", "hapticd/status")
    with Service(machine, config=LEAKING) as service, Subscriber(service.endpoint, *topics) as subscriber:
        subscriber.until("hapticd/status")  # it is heard
        service.write(PRESSED)  # for the next one
        with group_of(service):
            lost = subscriber.until("hapticd/event", code=EventCode.CONTROL_LOST)
            assert "without force" in lost["text"]
            service.restarted()
        assert gone(service.control)
