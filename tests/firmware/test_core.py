"""The protocol core on the host: against the vectors under sanitizers, against a fuzzer, strictly compiled."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.firmware.tools import FIRMWARE, HERE, need, run

HOST_RIG = FIRMWARE / "host-rig"


def test_the_core_does_what_the_vectors_and_sessions_say_under_sanitizers(tmp_path: Path) -> None:
    need("make", "gcc")
    said = run("make", "-C", HOST_RIG, f"BUILD={tmp_path}", "test")
    failed = re.findall(r"(\d+) checks, (\d+) failed", said)
    assert len(failed) == 3
    assert all(int(checks) > 500 and int(wrong) == 0 for checks, wrong in failed)


def test_the_core_is_strict_c99_with_memory_functions_as_its_only_library(tmp_path: Path) -> None:
    need("gcc", "nm")
    allowed = {"memcpy", "memset"}
    sources = sorted((FIRMWARE / "protocol").glob("*.c"))
    own, foreign = set[str](), set[str]()
    for source in sources:
        compiled = tmp_path / f"{source.stem}.o"
        strict = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wpedantic", "-Werror")
        run("gcc", *strict, "-ffreestanding", "-fno-stack-protector", "-O2", "-c", source, "-o", compiled)
        own |= set(run("nm", "--defined-only", "--format=just-symbols", compiled).split())
        foreign |= set(run("nm", "--undefined-only", "--format=just-symbols", compiled).split())
    assert "rig_receive" in own
    assert foreign - own - {"_GLOBAL_OFFSET_TABLE_"} <= allowed


def test_a_fuzzer_finds_no_way_to_a_force_that_the_protocol_does_not_allow(tmp_path: Path) -> None:
    need("make", "clang")
    assert _runs(tmp_path, HOST_RIG, seconds=5) > 100


@pytest.mark.nightly
def test_a_fuzzer_finds_none_in_ten_minutes_either(tmp_path: Path) -> None:
    need("make", "clang")
    assert _runs(tmp_path, HOST_RIG, seconds=600) > 100_000


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("file", "right", "wrong"),
    [
        ("rig.c", "!crc_fits(message, length)", "(crc_fits(message, length), false)"),
        ("rig.c", "ahead == 0 || ahead > 0x7fff", "ahead == 0"),
        ("rig.c", "ahead == 0 || ahead > 0x7fff", "ahead > 0x7fff"),
        ("rig.c", "rig->enabled || rig->fault != RIG_NO_FAULT", "rig->enabled"),
        ("rig.c", "    rig_work(rig); /* first", "    /*"),
        ("rig.c", "rig->fault != RIG_NO_FAULT && !slipped", "rig->fault != RIG_NO_FAULT"),
        ("rig.c", "slipped && !knows_home", "false && !knows_home"),
        ("rig.c", "forget_problem(rig->board, rig->fault)", "forget_problem(rig->board, RIG_SENSOR_FAULT)"),
        ("rig.c", "    look_for_problems(rig); /* one", "    /*"),
        ("rig.c", "if (rig->fault != RIG_SENSOR_FAULT)", "if (true)"),
        ("frame.c", "receiver->collected == FRAME_ENCODED_MAX", "receiver->collected > FRAME_ENCODED_MAX"),
    ],
    ids=["crc", "order", "twice", "fault", "late", "slip", "lost", "forget", "next", "home", "overlong"],
)
def test_the_fuzzer_finds_a_core_that_is_broken(tmp_path: Path, file: str, right: str, wrong: str) -> None:
    need("make", "clang")
    for folder in ("protocol", "host-rig"):
        shutil.copytree(FIRMWARE / folder, tmp_path / "a" / "b" / folder)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "firmware").symlink_to(HERE)
    source = tmp_path / "a" / "b" / "protocol" / file
    text = source.read_text()
    assert text.count(right) == 1
    source.write_text(text.replace(right, wrong))
    with pytest.raises(AssertionError, match=r"the model|not told|AddressSanitizer|runtime error"):
        _runs(tmp_path / "build", tmp_path / "a" / "b" / "host-rig", seconds=120)


def _runs(build: Path, host_rig: Path, seconds: int) -> int:
    """How many inputs the fuzzer has tried."""
    command = ["make", "-C", str(host_rig), f"BUILD={build}", f"FUZZ_SECONDS={seconds}", "fuzz"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + 300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"number_of_executed_units: (\d+)", done.stderr)
    assert found is not None
    return int(found[1])
