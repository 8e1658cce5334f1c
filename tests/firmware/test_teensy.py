"""hid-rig's own program compiled and linked for the Teensy's processor.

The core library is in no package registry, so its symbols come from `cortex_m7/core.c`. With the real one at hand,
`TEENSY_CORE=.../cores/teensy4 pytest -m nightly tests/firmware/test_teensy.py` builds the firmware by its own Makefile.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.firmware.tools import FIRMWARE, HERE, need, run

TARGET = ("--target=thumbv7em-none-eabihf", "-mcpu=cortex-m7", "-mfpu=fpv5-d16")
STRICT = ("-std=gnu11", "-O2", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-ffreestanding", "-ffunction-sections")


def test_it_links_for_a_cortex_m7(tmp_path: Path, record_property: Callable[[str, object], None]) -> None:
    need("clang", "ld.lld", "size", "nm")
    protocol = FIRMWARE / "protocol"
    own = [FIRMWARE / "hid-rig" / "main.c", *(protocol / f"{name}.c" for name in ("crc16", "report", "rig", "speech"))]
    folders = [HERE / "cortex_m7", HERE / "teensy", protocol, FIRMWARE / "hid-rig"]
    objects = []
    for source in [*own, HERE / "cortex_m7" / "core.c"]:
        objects.append(tmp_path / f"{source.stem}.o")
        run("clang", *TARGET, *STRICT, *(f"-I{folder}" for folder in folders), "-c", source, "-o", objects[-1])
    elf = tmp_path / "hid-rig.elf"
    run("ld.lld", "--entry=main", "--gc-sections", "--no-undefined", *objects, "-o", elf)
    text, data, bss = (int(size) for size in run("size", elf).splitlines()[1].split()[:3])
    record_property("text_bytes", text)
    figures = f"text {text}, data {data}, bss {bss}"
    record_property("prints", f"firmware hid-rig on a Cortex-M7, without the core library: {figures}")
    assert {"main", "rig_receive", "report_make"} <= set(run("nm", "--format=just-symbols", elf).split())
    assert 2000 < text < 8000
    assert bss < 1000


@pytest.mark.nightly
@pytest.mark.parametrize("core", [path for path in [os.environ.get("TEENSY_CORE")] if path])
def test_it_links_with_the_real_core_library(core: str, tmp_path: Path) -> None:
    made = run("make", "-C", FIRMWARE / "hid-rig", f"TEENSY_CORE={core}", f"BUILD={tmp_path / 'build'}")
    found = re.search(r"^\s*(\d+)\s+(\d+)\s+(\d+)\s+\d+\s+\w+\s+\S*hid-rig\.elf", made, re.MULTILINE)
    assert found is not None
    print(f"with the core library: text {found[1]}, data {found[2]}, bss {found[3]}")  # noqa: T201 - the figures
    assert 10_000 < int(found[1]) < 30_000
