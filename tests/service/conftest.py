"""A machine with hapticd installed, and its service."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.machine import Machine, booted
from tests.service.unit import Service


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    """A machine with hapticd installed, as `make install` does it."""
    with booted(tmp_path_factory.mktemp("machine") / "console") as machine:
        machine.run("make", "-C", "/opt/src", "install")
        latency = Path("/dev/cpu_dma_latency")
        if latency.exists():  # a container has no udev to make it and give it to the group
            major, minor = os.major(latency.stat().st_rdev), os.minor(latency.stat().st_rdev)
            machine.run("mknod", "--mode=0660", str(latency), "c", str(major), str(minor))
            machine.run("chgrp", "hapticd", str(latency))
        yield machine


@pytest.fixture
def service(machine: Machine) -> Iterator[Service]:
    with Service(machine) as service:
        yield service.pressing()
