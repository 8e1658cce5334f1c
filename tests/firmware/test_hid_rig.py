"""hid-rig's own program on the host: only the Teensy core library, which cannot be had here, is replaced by pipes."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd_drivers.rig import messages
from tests.firmware.tools import FIRMWARE, HERE, need, run


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("gcc")
    built = tmp_path_factory.mktemp("hid-rig") / "hid-rig"
    protocol = FIRMWARE / "protocol"
    core = [protocol / f"{name}.c" for name in ("crc16", "report", "rig", "speech")]
    folders = (f"-I{HERE / 'teensy'}", f"-I{protocol}", f"-I{FIRMWARE / 'hid-rig'}")
    strict = ("-std=gnu11", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fsanitize=address,undefined")
    run("gcc", *strict, *folders, FIRMWARE / "hid-rig" / "main.c", HERE / "teensy" / "core.c", *core, "-o", built)
    return built


def report(message: bytes) -> str:
    """The line that lets a report come."""
    return f"report {(bytes([len(message)]) + message).ljust(64, bytes(1)).hex()}"


def live(program: Path, *lines: str) -> list[messages.Message | str]:
    """What the rig does about it: messages decoded, motor lines as they are."""
    done: list[messages.Message | str] = []
    for line in run(program, given="\n".join(lines) + "\n").splitlines():
        if line.startswith("report "):
            raw = bytes.fromhex(line.split()[1])
            assert len(raw) == 64
            assert raw[1 + raw[0] :] == bytes(63 - raw[0])
            message = messages.decode(raw[1 : 1 + raw[0]])
            assert message is not None
            done.append(message)
        else:
            done.append(line)
    return done


def test_reports_are_understood_and_answered(program: Path) -> None:
    identity, axis = live(program, report(messages.hello(7)), report(messages.describe(8, 0)))
    assert isinstance(identity, messages.Identity)
    assert (identity.model, identity.echo, identity.host_silence_ms) == ("hid-rig", 7, 20)
    assert isinstance(axis, messages.Axis)
    assert axis.max_force_un == 5_000_000


@pytest.mark.parametrize(("un", "pins"), [(2_500_000, "motor 1 1024"), (-5_000_000, "motor 0 2048"), (1, "motor 1 0")])
def test_a_force_becomes_direction_and_duty(program: Path, un: int, pins: str) -> None:
    lines = [report(messages.hello(1)), report(messages.enable(2)), report(messages.force(3, 0, [un])), "motor"]
    assert live(program, *lines)[-1] == pins


def test_silence_stops_the_motor(program: Path) -> None:
    start = [report(messages.hello(1)), report(messages.enable(2)), report(messages.force(3, 0, [2_500_000]))]
    assert live(program, *start, "time 20000", "motor")[-1] == "motor 1 1024"
    stopped = live(program, *start, "time 20001", "motor", report(messages.poll(4, 0)))
    assert stopped[-2] == "motor 1 0"
    assert isinstance(stopped[-1], messages.State)
    assert stopped[-1].flags == messages.TRIPPED


def test_edges_are_counted_both_ways_and_a_slip_is_a_fault(program: Path) -> None:
    up = ["edge 2 1", "edge 3 1", "edge 2 0", "edge 3 0"]
    down = ["edge 3 1", "edge 2 1", "edge 3 0", "edge 2 0"]
    hello = report(messages.hello(1))
    *_, state = live(program, hello, *up, *up, *down, report(messages.poll(2, 0)))
    assert isinstance(state, messages.State)
    assert (state.position, state.fault) == ([4], 0)
    assert [type(said) for said in live(program, hello, "slip", "time 1")] == [messages.Identity, messages.Fault]


def test_buttons_and_home_switch_are_active_low(program: Path) -> None:
    *_, state = live(program, report(messages.hello(1)), "edge 6 0", "edge 7 0", report(messages.poll(2, 0)))
    assert isinstance(state, messages.State)
    assert (state.flags, state.buttons) == (messages.HOME_SWITCH_CLOSED, 1)
