"""An FTDI adapter as the kernel shows it, by umockdev: found by its USB identity, and asked for low latency."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

PRELOAD = "libumockdev-preload.so.0"
LOW_LATENCY = 0x2000  # of the kernel's serial_struct

CLIENT = """
from hapticd_drivers.rig.serial_link import SerialLink
from hapticd_drivers.rig.serial_ports import choose, latency_timer
from hapticd_drivers.rig.serial_rig import SerialRig
print(*(f"{found.model}|{found.serial}|{found.where}|{found.problem}" for found in SerialRig.find()))
port = choose("usb:0403:6001:A50285BI")
before = latency_timer(port.path).read_text().strip()
link = SerialLink(port, 1_000_000, low_latency=True)
print(port.path, before, latency_timer(port.path).read_text().strip(), link.notes)
link.close()
"""


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    command = ["pkg-config", "--cflags", "--libs", "umockdev-1.0"]
    flags = subprocess.run(command, capture_output=True, text=True, check=False)
    if flags.returncode:
        pytest.skip("no umockdev: sudo apt install umockdev libumockdev-dev pkg-config")
    source = Path(__file__).parent / "serial_double" / "main.c"
    program = tmp_path / "serial_double"
    subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", source, *flags.stdout.split(), "-o", program], check=True)
    with subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def line_of(stream: IO[str] | None) -> str:
    assert stream is not None
    return stream.readline().strip()


def test_an_adapter_is_found_by_its_usb_identity_and_asked_not_to_keep_bytes_back(
    adapter: subprocess.Popen[str],
) -> None:
    environment = {**os.environ, "LD_PRELOAD": PRELOAD, "UMOCKDEV_DIR": line_of(adapter.stdout)}
    done = subprocess.run(
        [sys.executable, "-c", CLIENT], env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["FT232R USB UART|A50285BI|/dev/ttyUSB0|", "/dev/ttyUSB0 16 1 ()"]
    assert adapter.stdin is not None
    adapter.stdin.write("flags\n")
    adapter.stdin.flush()
    assert int(line_of(adapter.stdout), 16) & LOW_LATENCY
