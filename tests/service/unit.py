"""A unit of a machine: started with a configuration, and what there is to see of it and to do."""

from __future__ import annotations

from tests.daemon.running import Subscriber
from tests.daemon.test_deaths import PRESSED
from tests.service.machine import Machine, eventually

CONFIG = "/etc/hapticd/hapticd.toml"


class Service:
    """A unit of the machine that runs, and what to see and do."""

    def __init__(self, machine: Machine, instance: str = "default", config: str = PRESSED) -> None:
        self.machine = machine
        self.unit = "hapticd.service" if instance == "default" else f"hapticd@{instance}.service"
        self.file = CONFIG if instance == "default" else f"/etc/hapticd/{instance}.toml"
        self.endpoint = f"ipc://{machine.path(f'/run/hapticd/{instance}/telemetry')}"
        self.write(config)
        self._forget_failures()
        try:
            machine.run("systemctl", "start", self.unit)
            self.supervisor, self.control = machine.processes(self.unit)
        except BaseException:  # or the next test would find it started
            self._stop()
            raise

    def __enter__(self) -> Service:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def _stop(self) -> None:
        self.machine.run("systemctl", "stop", self.unit)
        self._forget_failures()

    def _forget_failures(self) -> None:
        """Let systemd not count how often tests start the unit."""
        self.machine.run("systemctl", "reset-failed", "hapticd.service", "hapticd@*.service", check=False)

    def write(self, config: str) -> None:
        self.machine.path(self.file).write_text(config)

    def show(self, key: str) -> str:
        return self.machine.show(self.unit, key)

    def pressing(self) -> Service:
        """Return when the daemon holds a force against the hand."""
        with Subscriber(self.endpoint, "hapticd/position") as subscriber:
            for _, fields in subscriber.maps():
                if fields["seq"] > 300 and abs(fields["force_n"][0]) > 2.0:
                    return self
        raise AssertionError("no force")

    def restarted(self) -> None:
        """Return when systemd has started it again after a failure, and it ticks."""
        eventually(lambda: self.show("NRestarts") == "1", "the restart", self.machine)
        eventually(lambda: self.show("ActiveState") == "active", "ticks after the restart", self.machine)
        assert (self.supervisor, self.control) != self.machine.processes(self.unit)
