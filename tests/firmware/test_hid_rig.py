"""hid-rig's own program on the host: only the Teensy core library, which cannot be had here, is replaced by pipes."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd_drivers.rig import messages
from tests.firmware.tools import FIRMWARE, HERE, need, run

POWER_ON, BY_WATCHDOG = 1 << 0, 1 << 4
"""Bits of the reset cause register."""
SENSOR, RESTART = 1, 3
"""Faults of the protocol."""


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


def live(program: Path, *lines: str, reset_cause: int = POWER_ON) -> list[messages.Message | str]:
    """What the rig does about it: messages decoded, other lines as they are."""
    done: list[messages.Message | str] = []
    command = ("env", f"RESET_CAUSE={reset_cause}", program)
    for line in run(*command, given="\n".join(lines) + "\n").splitlines():
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


def test_the_ttl_input_is_a_button_and_the_sync_output_turns_once_a_tick(program: Path) -> None:
    said = live(
        program,
        report(messages.hello(1)),
        "sync",
        report(messages.enable(2)),
        "sync",
        "edge 8 1",
        report(messages.force(3, 0, [0])),
        "sync",
        "edge 8 0",
        report(messages.poll(4, 100)),
        "sync",
        "time 100",
        "sync",
        report(messages.disable(5)),
        "sync",
    )
    assert [line for line in said if isinstance(line, str)] == [
        "sync 0",
        "sync 0",
        "sync 1",
        "sync 1",
        "sync 0",
        "sync 0",
    ]
    buttons = [state.buttons for state in said if isinstance(state, messages.State)]
    assert buttons == [0, 2, 0, 0]


@pytest.mark.parametrize("line", ["time 1", "edge 2 1", "slip", "edge 7 0", report(messages.hello(1))])
def test_the_watchdog_is_fed_once_a_round_and_by_no_interrupt(program: Path, line: str) -> None:
    """What resets a program that hangs: 0.5 s, enabled, and neither of the requests that are made by writing 0."""
    wdog = f"watchdog {0x04 | 0x10 | 0x20:04x} 5555 aaaa"
    said = live(program, "watchdog", line, "watchdog")
    assert (said[0], said[-1]) == (wdog, wdog)


def test_a_restart_by_the_watchdog_is_a_fault_until_somebody_disables(program: Path) -> None:
    start = [report(messages.hello(1)), report(messages.enable(2)), report(messages.force(3, 0, [2_500_000])), "motor"]
    again = [
        report(messages.disable(4)),
        report(messages.enable(5)),
        report(messages.force(6, 0, [2_500_000])),
        "motor",
    ]
    told, _, refused, _, still, *_, enabled, _, moving, causes = live(
        program, *start, *again, "causes", reset_cause=BY_WATCHDOG
    )
    assert isinstance(told, messages.Fault)
    assert (told.fault, told.axis, told.detail) == (RESTART, messages.NO_AXIS, BY_WATCHDOG)
    assert isinstance(refused, messages.State)
    assert (refused.flags & messages.ENABLED, refused.fault) == (0, RESTART)
    assert isinstance(enabled, messages.State)
    assert (enabled.flags & messages.ENABLED, enabled.fault) == (messages.ENABLED, 0)
    assert (still, moving) == ("motor 1 0", "motor 1 1024")
    assert causes == f"causes {BY_WATCHDOG:x}", "what is not cleared is told again after the next start"


def test_a_slip_behind_a_restart_takes_the_home_away_and_neither_is_forgotten(program: Path) -> None:
    said = live(
        program,
        report(messages.hello(1)),
        report(messages.set_home(2, 0, 0)),
        report(messages.poll(3, 0)),
        "slip",
        report(messages.disable(4)),
        report(messages.disable(5)),
        report(messages.enable(6)),
        reset_cause=BY_WATCHDOG,
    )
    faults = [message.fault for message in said if isinstance(message, messages.Fault)]
    states = [message for message in said if isinstance(message, messages.State)]
    assert faults == [RESTART, SENSOR, RESTART]
    assert [(state.flags, state.fault) for state in states] == [
        (messages.HOMED, RESTART),
        (0, RESTART),
        (0, 0),
        (messages.ENABLED, 0),
    ]


def test_no_home_is_known_while_a_slip_is_pending(program: Path) -> None:
    *_, homeless, cleared, _, homed = live(
        program,
        report(messages.hello(1)),
        "slip",
        report(messages.set_home(2, 0, 0)),
        report(messages.poll(3, 0)),
        report(messages.disable(4)),
        report(messages.set_home(5, 0, 0)),
        report(messages.poll(6, 0)),
    )
    assert isinstance(homeless, messages.State)
    assert isinstance(cleared, messages.State)
    assert isinstance(homed, messages.State)
    assert (homeless.flags, homeless.fault) == (0, SENSOR)
    assert (cleared.flags, cleared.fault) == (0, 0)
    assert (homed.flags, homed.fault) == (messages.HOMED, 0)


def test_being_switched_on_is_no_fault(program: Path) -> None:
    _, state = live(program, report(messages.hello(1)), report(messages.enable(2)))
    assert isinstance(state, messages.State)
    assert (state.flags & messages.ENABLED, state.fault) == (messages.ENABLED, 0)
