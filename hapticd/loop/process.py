"""The process of the loop: what runs behind `python -m hapticd.loop.process`.

The supervisor starts it with the configuration's text on its standard input and one end of a socket pair as its
descriptor `--socket`. Over that it hears when to go on, once there is what takes a force away, and answers with one
packet: what it found and the descriptor of the shared memory, or why it cannot run.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import socket
import sys
import time
import traceback
from dataclasses import asdict, dataclass, replace
from types import ModuleType

import msgpack

from hapticd import plugins
from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.walls import MAX_WALLS
from hapticd.device import DeviceInfo
from hapticd.errors import ConfigError, DeviceNotFoundError, DriverError, HapticdError, PluginError
from hapticd.loop.force_mark import ForceMark
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import DEVICE_LOST, FORCE_LEFT, GO, SUPERVISOR_BEAT, SharedMemory
from hapticd.loop.realtime import become_realtime, die_with_parent, leave_realtime, sleep_until
from hapticd.loop.resume import ResumeState, identity
from hapticd.loop.sources import edited, loaded
from hapticd.loop.warm_up import warm_up
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.event import EventCode
from hapticd.tick.record import RecordLayout
from hapticd.version import __version__

_LONGEST_ERROR = 1 << 14


def main() -> int:
    """Run the loop; the exit code says how it went."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--socket", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--mark", type=int, required=True)
    arguments = parser.parse_args()
    # An interrupt of the terminal and `systemctl kill -s HUP` go to every process; the supervisor alone decides what
    # they mean.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    channel = socket.socket(fileno=arguments.socket)
    try:
        try:
            asked = _asked()
        finally:  # no force before there is what takes it away; and what is left unread here would undo a refusal
            going = channel.recv(len(GO)) == GO
        if not going:
            return 1  # the supervisor is gone
        control = _prepare(asked, channel, arguments.parent)
    except HapticdError as error:
        if _debugs():
            traceback.print_exception(error)
        with contextlib.suppress(ConnectionError):
            refusal = {"error": str(error)[:_LONGEST_ERROR], "exit_code": error.exit_code}
            channel.send(msgpack.packb(refusal, unicode_errors="surrogateescape"))
        return error.exit_code
    except ConnectionError:
        return 1  # the supervisor is gone
    ended = 0
    mark = ForceMark(arguments.mark)
    mark.set()
    try:
        control.run()
    except DriverError as error:  # the event says why
        if _debugs():
            traceback.print_exception(error)
        ended = DEVICE_LOST
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # systemd and the supervisor both send one; it is over
        leave_realtime()
    force_left = control.session.driver.force_left
    if not force_left:
        mark.clear()
    else:
        sys.stderr.write(f"the driver could not take the force away: {force_left}\n")
    return FORCE_LEFT if force_left else ended


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the loop is to run, with everything imported that it may need."""

    config: LoadedConfig
    accuracy: str
    resume: ResumeState
    laws: dict[str, ModuleType]


def _debugs() -> bool:
    return os.environ.get("HAPTICD_DEBUG") == "1"


def _asked() -> _Asked:
    request = msgpack.unpackb(sys.stdin.buffer.read(), unicode_errors="surrogateescape")
    if request.get("version") != __version__:
        raise HapticdError(
            f"hapticd {__version__} was installed while {request.get('version')} runs: restart the daemon"
        )
    config = parse(request["text"], request["name"])
    config, accuracy = _fitted(config)
    return _Asked(config, accuracy, ResumeState(**request["resume"]), _installed_laws())


def _prepare(asked: _Asked, channel: socket.socket, parent_pid: int) -> ControlLoop:
    config, resume = asked.config, asked.resume
    settings = config.config
    driver = config.make_driver()
    place_device(config, driver)
    info = driver.open()
    try:
        if resume.device not in ("", identity(info)):
            raise DeviceNotFoundError(f"found {identity(info)} instead of {resume.device}: restart hapticd to use it")
        _check_watchdog(config, info)
        layout = RecordLayout(len(info.axes), info.has_orientation, MAX_WALLS)
        shared = SharedMemory(layout, settings.loop.rate_hz)
        tick = make_tick(config, info)
        before, resume = resume, loaded(resume, config)
        control = ControlLoop(
            driver,
            tick,
            shared,
            settings.loop,
            settings.safety,
            (info.simulated or settings.safety.auto_arm) and resume.may_arm,
            sleep_until,
            resume,
        )
        if names := ", ".join(edited(before, resume, config)):
            text = f"stays disarmed: edited since it was loaded: {names}; `hapticd arm` for what it is now"
            control.session.event(EventCode.DISARMED, text)
        for name, law in asked.laws.items():
            control.requests.know(name, law)
        control.requests.know(settings.controller.law, config.law)
        warm_up(make_tick(config, info))

        def stop(_signal: int, _frame: object) -> None:
            control.session.stop_requested = True

        signal.signal(signal.SIGTERM, stop)
        die_with_parent(parent_pid)
        problems, advice = become_realtime(settings.loop)
        control.requests.worker.start()  # before the supervisor counts how long no tick has come
        shared.words[SUPERVISOR_BEAT] = time.monotonic_ns()
        hello = {"info": asdict(info), "realtime": not problems, "warnings": problems + advice, "pid": os.getpid()}
        hello["accuracy"] = asked.accuracy
        socket.send_fds(channel, [msgpack.packb(hello)], [shared.descriptor])
        channel.close()
    except BaseException:
        driver.close()
        raise
    return control


def _fitted(config: LoadedConfig) -> tuple[LoadedConfig, str]:
    """The configuration with the device model that it asks for, and why that one."""
    if getattr(config.options, "accuracy", None) is None:
        return config, ""
    from hapticd.offline.model_choice import fit  # only those who ask pay for it, and it needs `make_tick` from here

    found = fit(config)
    return (config, "") if found is None else (replace(config, options=found.options), found.reason)


def _check_watchdog(config: LoadedConfig, info: DeviceInfo) -> None:
    """Refuse a real device that would keep its force when this computer dies, unless the user has accepted that."""
    if info.host_silence_ms is None and not info.simulated and not config.config.device.accept_no_watchdog:
        raise ConfigError(
            f"{config.path}: device.accept_no_watchdog = false: {info.model} keeps its last force when this computer "
            "stops; read docs/safety.md, then set it to true"
        )


def _installed_laws() -> dict[str, ModuleType]:
    """Every installed law that can be imported, so that a switch imports nothing."""
    laws = {}
    for name in plugins.names(plugins.CONTROLLERS):
        try:
            laws[name] = plugins.law(name)
        except PluginError:
            continue  # it is refused by name when somebody asks for it
    return laws


if __name__ == "__main__":
    sys.exit(main())
