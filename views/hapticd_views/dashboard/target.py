"""Which daemon the page shows, and how it is reached."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hapticd.client import Client
from hapticd.client.commands import command
from hapticd.errors import ClientError
from hapticd.paths import DEFAULT_INSTANCE, telemetry_endpoint

_TOPICS = ("position", "energy", "damping", "timing", "cycle", "event", "status")


@dataclass(frozen=True, slots=True)
class Target:
    """A daemon on this computer by its name, or one elsewhere by its endpoints.

    Attributes:
        instance: its name on this computer, when no endpoints are given.
        telemetry: its `telemetry.tcp` as seen from here.
        control: its `control.tcp` as seen from here; None beside `telemetry`: it is only watched.
        keys: key file for a daemon on another computer.
    """

    instance: str = DEFAULT_INSTANCE
    telemetry: str | None = None
    control: str | None = None
    keys: Path | None = None

    @property
    def is_here(self) -> bool:
        """Whether it runs on this computer, so that its file can be edited."""
        return self.telemetry is None

    @property
    def endpoint(self) -> str:
        """Where it publishes, or would.

        Raises:
            ConfigError, InstanceError: as `hapticd.paths.locate`.
        """
        return self.telemetry or telemetry_endpoint(self.instance)

    def subscribe(self) -> Client:
        """A subscription to all that the page shows.

        Raises:
            ClientError, ConfigError, InstanceError: as `hapticd.client.Client`.
        """
        return Client(self.endpoint, topics=_TOPICS, keys=self.keys)

    def ask(self, do: str) -> None:
        """Have the daemon do something, and return when it has answered: `disarm` once the device has let go.

        Raises:
            HapticdError: as `hapticd.client.commands.command`.
        """
        if not self.is_here and self.control is None:
            raise ClientError(f"{self.telemetry} is only watched: name its control.tcp with --control")
        waits = {"wait": True} if do == "disarm" else {}
        command(do, self.instance, connect=self.control, keys=self.keys, **waits)
