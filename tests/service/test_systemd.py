"""The installed service under a real systemd: started, switched, hurt and stopped as an administrator would see it."""

from __future__ import annotations

import json
import os
import re
import signal
import statistics
import time
from pathlib import Path

import pytest

from hapticd.loop.memory import RECORDS, SharedMemory
from hapticd.tick.event import EventCode
from tests.daemon.running import Subscriber, all_records, gone, wait_until
from tests.daemon.test_deaths import PRESSED, ramped_out
from tests.service.machine import Machine, eventually, memory_of
from tests.service.unit import CONFIG, Service

pytestmark = pytest.mark.timeout(900)  # the first machine ever has to be made

SLOW_LAW = '''
"""A law that takes its time with the very first step."""
import time
from hapticd.law import LawParams
class Params(LawParams):
    """None."""
class State:
    """Nothing."""
    asked: int
def start(state, params, snapshot):
    """Nothing."""
def step(state, params, tick):
    """Sleep."""
    time.sleep(60.0)
    return tick.contact_n
'''


def ramped_out_since(memory: SharedMemory, since_ns: int) -> bool:
    """Whether the force went to zero in small steps from then on; how the hand came into the wall does not matter."""
    return ramped_out([record for record in all_records(memory) if record.deadline_ns > since_ns])


def test_the_installed_units_have_no_fault(machine: Machine) -> None:
    done = machine.run("systemd-analyze", "verify", "hapticd.service", "hapticd@left.service")
    assert done.stdout + done.stderr == ""


def test_everything_is_installed_and_nothing_is_started(machine: Machine) -> None:
    done = machine.run("hapticd", "service", "status", check=False)
    states = [line.split()[0] for line in done.stdout.splitlines()]
    assert states == ["installed"] * 11 + ["inactive"]
    assert done.returncode == 1


def test_it_is_ready_only_when_the_loop_ticks(machine: Machine) -> None:
    packages = next(machine.path("/opt/hapticd/lib").glob("python3*")) / "site-packages"
    (packages / "mylab").mkdir(exist_ok=True)
    (packages / "mylab/slow.py").write_text(SLOW_LAW)
    machine.path(CONFIG).write_text(PRESSED + '[controller]\nlaw = "mylab.slow"\n')
    machine.run("systemctl", "start", "--no-block", "hapticd")
    eventually(lambda: machine.show("hapticd", "MainPID") != "0", "the daemon's process", machine)
    time.sleep(3.0)  # an ordinary start takes one
    assert machine.show("hapticd", "ActiveState") == "activating"
    machine.run("systemctl", "stop", "hapticd")
    machine.run("systemctl", "reset-failed", "hapticd", check=False)

    with Service(machine) as service:
        assert service.show("ActiveState") == "active"
        assert memory_of(service.control).words[RECORDS] > 0


def test_it_has_the_rights_of_a_loop_and_no_others(service: Service) -> None:
    for pid in (service.supervisor, service.control):
        status = dict(line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        uid = service.machine.run("id", "--user", "hapticd").stdout.strip()
        assert set(status["Uid"].split()) == {uid} != {"0"}
        assert int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 1 << 23 | 1 << 14  # CAP_SYS_NICE, CAP_IPC_LOCK
        assert status["NoNewPrivs"] == "1"
        assert status["Seccomp"] == "2"
    assert os.sched_getscheduler(service.supervisor) == os.SCHED_OTHER
    assert os.sched_getscheduler(service.control) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    locked = re.search(r"VmLck:\s+(\d+) kB", Path(f"/proc/{service.control}/status").read_text())
    assert locked
    assert int(locked[1]) > 1000
    with Subscriber(service.endpoint, "hapticd/status") as subscriber:
        status = subscriber.until("hapticd/status")
        assert status["realtime"]
        assert [warning for warning in status["warnings"] if Path("/dev/cpu_dma_latency").exists()] == []


def test_the_status_text_shows_rate_and_law(service: Service) -> None:
    def rate_hz() -> float:
        said = re.fullmatch(r"(\d+) Hz, law ring-damping", service.show("StatusText"))
        return float(said[1]) if said else 0.0

    eventually(lambda: 800 < rate_hz() < 1200, "a rate near 1000 Hz", service.machine)
    assert "Hz, law ring-damping" in service.machine.run("hapticd", "service", "status").stdout


def test_the_journal_has_events_by_their_code(service: Service) -> None:
    def entries() -> list[dict[str, str]]:
        asked = service.machine.run(
            *("journalctl", "--unit=hapticd.service", f"HAPTICD_CODE={EventCode.ARMED:d}", "--output=json")
        )
        return [json.loads(line) for line in asked.stdout.splitlines()]

    eventually(lambda: bool(entries()), "the arming in the journal", service.machine)
    last = entries()[-1]
    assert last["MESSAGE"] == "armed: forces are let through"
    assert (last["HAPTICD_LAW"], last["HAPTICD_INSTANCE"], last["PRIORITY"]) == ("ring-damping", "default", "6")
    assert int(last["HAPTICD_TICK"]) >= 0


def test_the_group_reaches_the_sockets_and_nobody_else_does(service: Service) -> None:
    machine = service.machine
    machine.run("sh", "-c", "id member || useradd --groups hapticd member; id stranger || useradd stranger")
    directory = machine.path("/run/hapticd/default")
    assert directory.stat().st_mode & 0o777 == 0o750
    for name in ("telemetry", "control"):
        assert (directory / name).stat().st_mode & 0o067 == 0o060
    assert machine.run("hapticd", "disarm", user="member").returncode == 0
    refused = machine.run("hapticd", "arm", user="stranger", check=False)
    assert refused.returncode == 1
    with Subscriber(service.endpoint, "hapticd/status") as subscriber:
        assert not subscriber.until("hapticd/status")["armed"]


def test_its_keys_are_read_by_the_service_and_let_a_listed_user_command_it(machine: Machine) -> None:
    machine.run("hapticd", "keys", "make")
    machine.run("env", "--chdir=/run", "hapticd", "keys", "make", "laptop")
    keys = machine.path("/etc/hapticd/keys")
    group = int(machine.run("id", "--group", "hapticd").stdout)
    found = {path.name: path.stat() for path in (keys, *keys.rglob("*"))}
    assert {name: (place.st_mode & 0o777, place.st_uid, place.st_gid) for name, place in found.items()} == {
        "keys": (0o750, 0, group),
        "clients": (0o750, 0, group),
        "server.key_secret": (0o640, 0, group),
        "laptop.key": (0o640, 0, group),
    }
    config = PRESSED + '[control]\ntcp = "tcp://127.0.0.1:9873"\n'
    with Service(machine, config=config) as service, Subscriber(service.endpoint, "hapticd/status") as subscriber:
        command = ("hapticd", "disarm", "--connect", "tcp://127.0.0.1:9873", "--keys", "/run/laptop.key_secret")
        machine.run(*command)
        assert subscriber.until("hapticd/status", armed=False)
        machine.run("hapticd", "keys", "remove", "laptop")
        machine.run("systemctl", "reload", "hapticd")
        refused = machine.run(*command, check=False)
        assert refused.returncode == 1
        assert "does not let your key in" in refused.stderr
    machine.run("rm", "-r", "/etc/hapticd/keys", "/run/laptop.key_secret")


def test_a_reload_switches_the_law_without_a_missed_tick_or_a_restart(service: Service) -> None:
    before = service.show("MainPID"), service.show("NRestarts")
    skipped_at_switch = []
    for law in ("tdpa", "none", "ring-damping") * 3:
        with Subscriber(service.endpoint, "hapticd/position", "hapticd/event", "hapticd/timing") as subscriber:
            subscriber.until("hapticd/position")
            service.write(PRESSED + f'[controller]\nlaw = "{law}"\n')
            service.machine.run("systemctl", "reload", "hapticd")
            switched, seq = -1, -1
            deadlines: dict[int, int] = {}
            for topic, fields in subscriber.maps():
                if topic == "hapticd/event" and fields["code"] == EventCode.SWITCHED:
                    switched = fields["seq"]
                elif topic == "hapticd/timing":
                    deadlines[fields["seq"]] = fields["deadline_ns"]
                elif topic == "hapticd/position":
                    assert seq in (-1, fields["seq"] - 1), "a tick is missing"
                    seq = fields["seq"]
                if switched >= 0 and seq > switched + 50:
                    break
            around = [deadlines[tick] for tick in range(switched - 5, switched + 6) if tick in deadlines]
            skipped_at_switch.append(round((around[-1] - around[0]) * 1e-6) - (len(around) - 1))
            assert law in service.show("StatusText")
    # A busy computer may miss a tick at any time; a switch that costs one misses it every time.
    assert statistics.median(skipped_at_switch) == 0
    assert (service.show("MainPID"), service.show("NRestarts")) == before
    assert service.show("ActiveState") == "active"


def test_a_reload_of_a_bad_file_fails_and_changes_nothing(service: Service) -> None:
    with Subscriber(service.endpoint, "hapticd/status") as subscriber:
        config_hash = subscriber.until("hapticd/status")["config_hash"]
        service.write(PRESSED.replace("12000.0", "-1.0"))
        assert service.machine.run("systemctl", "reload", "hapticd", check=False).returncode != 0
        assert "stiffness_n_per_m" in service.machine.journal()
        assert service.show("ActiveState") == "active"
        assert service.machine.processes(service.unit) == (service.supervisor, service.control)
        for _ in range(2):
            assert subscriber.until("hapticd/status")["config_hash"] == config_hash


def test_a_stopped_control_process_is_released_and_the_service_restarted(service: Service) -> None:
    with Subscriber(service.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is heard
        os.kill(service.control, signal.SIGSTOP)
        event = subscriber.until("hapticd/event", code=EventCode.CONTROL_LOST)
        assert "without force" in event["text"]
    service.restarted()
    assert gone(service.control)


def test_a_stopped_supervisor_is_restarted_by_the_watchdog_after_a_ramp(service: Service) -> None:
    memory = memory_of(service.control)
    asked_ns = time.monotonic_ns()
    os.kill(service.supervisor, signal.SIGSTOP)
    service.restarted()
    assert "watchdog" in service.machine.journal().lower()
    assert ramped_out_since(memory, asked_ns)
    memory.close()


def test_a_killed_supervisor_leaves_the_loop_the_time_for_its_ramp(service: Service) -> None:
    memory = memory_of(service.control)
    asked_ns = time.monotonic_ns()
    os.kill(service.supervisor, signal.SIGKILL)
    wait_until(lambda: gone(service.control), "the control process to end")
    assert ramped_out_since(memory, asked_ns)
    service.restarted()
    memory.close()


def test_a_stop_ramps_the_force_out_and_ends_well(service: Service) -> None:
    memory = memory_of(service.control)
    asked_ns = time.monotonic_ns()
    service.machine.run("systemctl", "stop", "hapticd")
    assert (service.show("ExecMainStatus"), service.show("Result")) == ("0", "success")
    assert ramped_out_since(memory, asked_ns)
    assert not service.machine.path("/run/hapticd/default").exists()
    assert gone(service.control)
    memory.close()


def test_a_configuration_that_cannot_be_used_is_not_tried_again(machine: Machine) -> None:
    machine.path(CONFIG).write_text("[loop]\nrate_hz = 5\n")
    assert machine.run("systemctl", "start", "hapticd", check=False).returncode != 0
    assert (machine.show("hapticd", "ExecMainStatus"), machine.show("hapticd", "NRestarts")) == ("2", "0")
    assert machine.show("hapticd", "ActiveState") == "failed"
    machine.run("systemctl", "reset-failed", "hapticd")


def test_a_device_that_is_not_there_is_tried_again_for_as_long_as_it_takes(machine: Machine) -> None:
    machine.path(CONFIG).write_text('[device]\ndriver = "serial-rig"\noptions.port = "/dev/ttyUSB9"\n')
    assert machine.run("systemctl", "start", "hapticd", check=False).returncode != 0
    assert (machine.show("hapticd", "ExecMainStatus"), machine.show("hapticd", "SubState")) == ("1", "auto-restart")
    eventually(lambda: int(machine.show("hapticd", "NRestarts")) >= 2, "the second start by itself", machine)
    assert machine.show("hapticd", "StartLimitIntervalUSec") == "0"
    machine.run("systemctl", "stop", "hapticd")
    machine.run("systemctl", "reset-failed", "hapticd", check=False)


def test_each_instance_has_its_own_file_and_directory(machine: Machine) -> None:
    with Service(machine) as default, Service(machine, "left") as left, Service(machine, "right") as right:
        for service in (default, left, right):
            service.pressing()
        left.write(PRESSED + '[controller]\nlaw = "none"\n')
        machine.run("systemctl", "reload", "hapticd@left")
        eventually(lambda: "law none" in left.show("StatusText"), "the new law", machine)
        assert "law ring-damping" in right.show("StatusText")
        assert machine.path("/var/lib/hapticd/left").is_dir()
    assert machine.run("systemctl", "start", "hapticd@nobody", check=False).returncode == 0
    assert machine.show("hapticd@nobody", "ConditionResult") == "no"


def test_the_template_and_the_single_unit_do_not_meet(service: Service) -> None:
    service.machine.path("/etc/hapticd/default.toml").write_text(PRESSED)
    service.machine.run("systemctl", "start", "hapticd@default")
    assert service.show("ActiveState") == "inactive"
    service.machine.run("systemctl", "stop", "hapticd@default")


def test_nothing_is_written_outside_its_directories(service: Service) -> None:
    service.machine.run("systemctl", "reload", "hapticd")
    found = service.machine.run(
        "find", "/", "-path", "/proc", "-prune", "-o", "-user", "hapticd", "-print", check=False
    )
    places = ("/run/hapticd/", "/var/lib/hapticd/")
    assert [path for path in found.stdout.split() if not path.startswith(places)] == []
    assert "/run/hapticd/default/telemetry" in found.stdout


USB_DEVICE = """\
P: /devices/usb1/1-1
N: bus/usb/001/005
E: DEVTYPE=usb_device
E: SUBSYSTEM=usb
A: idVendor={vendor}\\n
A: idProduct={product}\\n
"""
MISC_DEVICE = """\
P: /devices/virtual/misc/cpu_dma_latency
N: cpu_dma_latency
E: DEVNAME=/dev/cpu_dma_latency
E: MAJOR=10
E: MINOR=120
E: SUBSYSTEM=misc
"""
BELOW_IT = """
P: /devices/usb1/1-1/1-1:1.0
E: DEVTYPE=usb_interface
E: SUBSYSTEM=usb

P: /devices/usb1/1-1/1-1:1.0/{subsystem}/{name}
N: {name}
E: SUBSYSTEM={subsystem}
"""
OWN_RULE = (
    'SUBSYSTEM=="tty", ATTRS{idVendor}=="16c0", ENV{HAPTICD_UNIT}="hapticd@left.service", SYMLINK+="hapticd/left"\n'
)


@pytest.mark.parametrize(
    ("vendor", "product", "subsystem", "name", "unit"),
    [
        ("1451", "0402", "", "", "hapticd@force-dimension.service"),
        ("0403", "cb48", "", "", "hapticd@falcon.service"),
        ("16c0", "0486", "hidraw", "hidraw3", "hapticd@hid-rig.service"),
        ("16c0", "0483", "tty", "ttyACM0", "hapticd@left.service"),
        ("0403", "6001", "tty", "ttyUSB0", ""),
        ("046d", "c077", "hidraw", "hidraw4", ""),
    ],
    ids=["force dimension", "falcon", "teensy", "a rig with a rule of its own", "some serial adapter", "some mouse"],
)
def test_udev_gives_a_haptic_device_to_the_group_and_starts_its_instance(
    machine: Machine, vendor: str, product: str, subsystem: str, name: str, unit: str
) -> None:
    machine.path("/etc/udev/rules.d/60-own.rules").write_text(OWN_RULE)
    device = USB_DEVICE.format(vendor=vendor, product=product)
    place = "/sys/devices/usb1/1-1"
    if subsystem:
        device += BELOW_IT.format(subsystem=subsystem, name=name)
        place += f"/1-1:1.0/{subsystem}/{name}"
    machine.path("/run/device.umockdev").write_text(device)
    done = machine.run("umockdev-run", "--device=/run/device.umockdev", "--", "udevadm", "test", place)
    said = done.stdout + done.stderr
    group = machine.run("id", "--group", "hapticd").stdout.strip()
    ours = [line for line in said.splitlines() if "70-hapticd.rules:" in line]
    wants = re.findall(r"^SYSTEMD_WANTS=(.*)$", said, re.MULTILINE)
    tags = re.findall(r"^TAGS=(.*)$", said, re.MULTILINE)
    if unit:
        assert any(f"GROUP {group}" in line for line in ours), said
        assert any("MODE 0660" in line for line in ours)
        assert wants == [unit]
        assert {"hapticd", "systemd", "uaccess"} <= set(tags[0].split(":"))
    else:
        assert (ours, wants) == ([], [])


def test_udev_lets_the_group_hold_the_processor_awake(machine: Machine) -> None:
    machine.path("/run/device.umockdev").write_text(MISC_DEVICE)
    place = "/sys/devices/virtual/misc/cpu_dma_latency"
    done = machine.run("umockdev-run", "--device=/run/device.umockdev", "--", "udevadm", "test", place)
    group = machine.run("id", "--group", "hapticd").stdout.strip()
    rules = re.findall(r"70-hapticd.rules:\d+ (\w+ \d+)", done.stdout + done.stderr)
    assert rules == [f"GROUP {group}", "MODE 0660"], done.stdout + done.stderr


def test_a_second_install_says_what_is_to_be_restarted_and_the_old_process_goes_on(machine: Machine) -> None:
    machine.run("systemctl", "start", "hapticd")
    before = machine.processes("hapticd")
    done = machine.run("make", "-C", "/opt/src", "install")
    assert "hapticd.service still runs what was installed before: systemctl restart hapticd.service" in done.stdout
    assert machine.processes("hapticd") == before
    machine.run("systemctl", "stop", "hapticd")


def test_an_uninstall_leaves_configurations_only(machine: Machine) -> None:
    """The last test: the machine has no service afterwards."""
    machine.run("systemctl", "enable", "--now", "hapticd@left")
    machine.path("/usr/local/lib/sysusers.d/hapticd.conf").unlink()  # one that is missing keeps no other
    for _ in range(2):
        machine.run("make", "-C", "/opt/src", "uninstall")
    assert machine.show("hapticd@left", "ActiveState") == "inactive"
    assert machine.show("hapticd", "LoadState") == "not-found"
    found = machine.run(
        "find", "/etc", "/usr", "/opt", "-path", "/opt/src", "-prune", "-o", "-name", "*hapticd*", "-print"
    )
    assert found.stdout.split() == [
        "/etc/hapticd",
        CONFIG,
    ]
