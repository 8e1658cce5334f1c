"""The binding against the ABI as a C compiler sees it, and the memory of both sides under a sanitiser."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hapticd.errors import PluginError
from hapticd_drivers.forcedimension import sdk as sdk_module
from hapticd_drivers.forcedimension.prototypes import OPTIONAL, PROTOTYPES, STATUS_WORDS
from hapticd_drivers.forcedimension.sdk import Sdk
from tests.drivers.forcedimension.bench import Bench
from tests.drivers.forcedimension.building import build

KINDS: dict[Any, str] = {
    ctypes.c_bool: "b",
    ctypes.c_byte: "c",
    ctypes.c_char: "c",
    ctypes.c_ubyte: "u",
    ctypes.c_ushort: "u",
    ctypes.c_uint: "u",
    ctypes.c_int: "i",
    ctypes.c_float: "f",
    ctypes.c_double: "f",
}
PROJECT = Path(__file__).parents[3]

Signatures = dict[str, tuple[str, ...]]


def shown(kind: Any) -> str:
    """A ctypes type as abi.c prints the C one: kind and bytes."""
    if kind is None:
        return "v"
    if kind is ctypes.c_char_p:
        return "*c1"
    pointed = getattr(kind, "_type_", None)
    if isinstance(pointed, type):
        return "*" + shown(pointed)
    return f"{KINDS[kind]}{ctypes.sizeof(kind)}"


def bound(prototypes: dict[str, tuple[Any, ...]]) -> Signatures:
    return {name: tuple(map(shown, kinds)) for name, kinds in prototypes.items()}


@pytest.fixture(scope="module")
def compiled(fake_sdk: Path) -> Signatures:
    lines = subprocess.run([fake_sdk / "abi"], check=True, capture_output=True, text=True).stdout.splitlines()
    return {line.split()[0]: tuple(line.split()[1:]) for line in lines}


def test_every_prototype_is_what_the_compiler_sees(compiled: Signatures) -> None:
    assert bound(PROTOTYPES) == compiled


def mistakes() -> Iterator[tuple[str, dict[str, tuple[Any, ...]]]]:
    """The table with one slip of the pen: an argument too few or too many, or another type in one place."""
    for name, kinds in PROTOTYPES.items():
        slips = [(*kinds, ctypes.c_byte)]
        for at, kind in enumerate(kinds):
            if at:
                slips.append(kinds[:at] + kinds[at + 1 :])
            others = [other for other in (*KINDS, ctypes.POINTER(ctypes.c_double)) if shown(other) != shown(kind)]
            slips += [(*kinds[:at], other, *kinds[at + 1 :]) for other in others]
        for slip in slips:
            yield name, {**PROTOTYPES, name: slip}


def test_any_slip_in_the_table_would_be_seen(compiled: Signatures) -> None:
    slips = list(mistakes())
    assert len(slips) > 800
    assert [name for name, table in slips if bound(table) == compiled] == []


def test_a_call_with_an_argument_too_few_or_of_another_kind_is_refused(bench: Bench) -> None:
    sdk = Sdk(str(bench.directory))
    bench.clear_log()
    for name, (_, *arguments) in PROTOTYPES.items():
        if arguments:
            with pytest.raises(TypeError):
                getattr(sdk, name)(*[0] * (len(arguments) - 1))
        for at, kind in enumerate(arguments):
            if kind is ctypes.c_bool:  # takes whatever is true or false
                continue
            with pytest.raises((ctypes.ArgumentError, TypeError)):
                getattr(sdk, name)(*["0" if index == at else 0 for index in range(len(arguments))])
    assert bench.log() == []


def test_python_and_c_see_the_same_session(bench: Bench, fake_sdk: Path) -> None:
    from_c = subprocess.run([fake_sdk / "abi", "play"], check=True, capture_output=True, text=True).stdout
    assert session(Sdk(str(fake_sdk))) == [[float(word) for word in line.split()] for line in from_c.splitlines()]


def session(sdk: Sdk) -> list[list[float]]:
    """What abi.c plays."""
    lines: list[list[float]] = []
    serial, firmware = ctypes.c_ushort(), ctypes.c_double()
    device = sdk.drdOpenID(0)
    result = sdk.dhdGetSerialNumber(ctypes.byref(serial), device)
    lines.append([device, sdk.dhdGetSystemType(device), result, serial.value])
    lines.append([sdk.dhdSetWatchdog(80, device), sdk.last_error()])
    result = sdk.dhdGetVersion(ctypes.byref(firmware), device)
    lines.append([result, firmware.value])
    lines.append(list(sdk.version))
    result = sdk.dhdEnableForce(1, device)
    lines.append([result, sdk.drdIsInitialized(device)])
    x, y, z = (ctypes.c_double() for _ in range(3))
    matrix = (ctypes.c_double * 9)()
    for tick in range(50):
        got = sdk.dhdGetPositionAndOrientationFrame(ctypes.byref(x), ctypes.byref(y), ctypes.byref(z), matrix, device)
        put = sdk.dhdSetForceAndTorqueAndGripperForce(1.5, -2.5, 0.25 * tick, 0, 0, 0, 0, device)
        lines.append([got, put, x.value, y.value, z.value, matrix[0] + matrix[4] + matrix[8]])
    status = (ctypes.c_int * STATUS_WORDS)(*[-7] * STATUS_WORDS)
    result = sdk.dhdGetStatus(status, device)
    lines.append([result, *status[:17]])
    assert set(status[17:]) == {-7}  # exactly 17 are written
    result = sdk.dhdStop(device)
    lines.append([result, sdk.drdClose(device)])
    return lines


def test_every_argument_arrives_in_its_place(bench: Bench) -> None:
    sdk = Sdk(str(bench.directory))
    device = sdk.drdOpenID(0)
    sdk.call("dhdEnableForce", 1, device)
    sdk.call("dhdSetForceAndTorqueAndGripperForce", 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, device)
    seen = [*bench.vector("force_n"), *bench.vector("torque_n_m"), bench.get("gripper_n")]
    assert seen == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    sdk.drdClose(device)


def exercise(directory: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tests.drivers.forcedimension.exercise", str(directory), *arguments],
        cwd=PROJECT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.fixture(scope="module")
def sanitised(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    library = subprocess.run(["cc", "-print-file-name=libasan.so"], check=True, capture_output=True, text=True)
    if not Path(library.stdout.strip()).is_absolute():
        pytest.skip("no address sanitiser: sudo apt install libgcc-12-dev")
    environment = {
        "LD_PRELOAD": library.stdout.strip(),
        "ASAN_OPTIONS": "detect_leaks=0",  # the interpreter frees little of its own at exit
        "PYTHONMALLOC": "malloc",  # so that buffers of ctypes have guarded edges
    }
    return build(tmp_path_factory.mktemp("sanitised"), "-fsanitize=address,undefined"), environment


def test_a_whole_life_is_clean_under_the_address_sanitiser(sanitised: tuple[Path, dict[str, str]]) -> None:
    directory, environment = sanitised
    run = exercise(directory, **environment)
    assert (run.returncode, run.stdout) == (0, "done\n"), run.stderr
    assert "Sanitizer" not in run.stderr
    assert "runtime error" not in run.stderr


def test_the_sanitiser_would_see_a_buffer_that_is_one_number_short(sanitised: tuple[Path, dict[str, str]]) -> None:
    directory, environment = sanitised
    run = exercise(directory, "short-status", **environment)
    assert run.returncode != 0
    assert "AddressSanitizer: heap-buffer-overflow" in run.stderr
    assert "dhdGetStatus" in run.stderr


def test_an_sdk_that_lacks_all_that_it_may_lack_still_drives_the_device(tmp_path: Path) -> None:
    """In a process of its own: two libraries with one name cannot be had in one."""
    run = exercise(build(tmp_path, *(f"-D{name}=gone_{name}" for name in OPTIONAL)))
    assert (run.returncode, run.stdout) == (0, "done\n"), run.stderr


def test_an_sdk_that_lacks_more_is_named_with_what_it_lacks(tmp_path: Path) -> None:
    source = tmp_path / "empty.c"
    source.write_text("int dhdErrorGetLast(void) { return 0; }\n")
    subprocess.run(["cc", "-shared", "-fPIC", str(source), "-o", str(tmp_path / "libdrd.so.3")], check=True)
    with pytest.raises(PluginError, match=r"lacks dhdDisableExpertMode, .*, drdStop: is it libdrd"):
        Sdk(str(tmp_path))


def test_the_sdk_is_looked_for_by_version_in_the_places_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    release = tmp_path / "lib" / "release" / f"lin-{os.uname().machine}-gcc"
    release.mkdir(parents=True)
    for name in ("libdrd.so.3.17.9", "libdrd.so.3.17.10", "libdrd.so.3.9.0", "libdhd.so.3"):
        (release / name).write_text("not a library")
    newest_first = [release / f"libdrd.so.{version}" for version in ("3.17.10", "3.17.9", "3.9.0")]
    assert sdk_module.candidates(str(tmp_path)) == newest_first
    assert sdk_module.candidates(str(release)) == newest_first
    monkeypatch.setenv("FDSDK", str(tmp_path))
    assert sdk_module.candidates(None)[:3] == newest_first
    named = release / "libdrd.so.3.17.9"
    assert sdk_module.candidates(str(named)) == [named]
    with pytest.raises(PluginError, match=r"invalid ELF header|file too short"):
        Sdk(str(named))


def test_dhd_names_resolve_through_libdrd_or_through_libdhd_beside_it(bench: Bench) -> None:
    sdk = Sdk(str(bench.directory / "libdrd.so.3"))
    assert all(sdk.has(name) for name in PROTOTYPES)
    assert sdk.version == (3, 17, 5, 0)
