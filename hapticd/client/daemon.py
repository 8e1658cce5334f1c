"""A running daemon: its telemetry and its commands in one object."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hapticd.client.commands import TIMEOUT_S, calibrate, command
from hapticd.client.connection import Client
from hapticd.client.remote import RemotePort
from hapticd.errors import ClientError, SilenceError
from hapticd.paths import DEFAULT_INSTANCE, SCENE, STATE, locate
from hapticd.telemetry.records import Sent, Status
from hapticd.telemetry.wire import Topic


def connect(
    instance: str = DEFAULT_INSTANCE,
    *,
    telemetry: str | None = None,
    control: str | None = None,
    keys: Path | str | None = None,
    topics: Sequence[type[Sent] | Topic | str] = tuple(Topic),
    timeout_s: float | None = None,
    receive_high_water: int = 1000,
) -> DaemonClient:
    """Connect to a running daemon. When this returns, everything that happens next arrives.

    Args:
        instance: name of a daemon on this computer, when no endpoints are given.
        telemetry: the daemon's `telemetry.tcp` as seen from here, such as "tcp://lab.example:9872".
        control: the daemon's `control.tcp` as seen from here; None beside `telemetry`: watch only.
        keys: key file for a daemon on another computer; None: the one that $HAPTICD_KEYS names, if any.
        topics: record classes, or topics by name, to iterate over; all unless given.
        timeout_s: longest silence while iterating [s]; None: wait for ever.
        receive_high_water: messages kept while the caller is busy; new ones are lost beyond it.

    Raises:
        ClientError: no such topic, or an endpoint that cannot be used.
        ConfigError: the key file or the instance's name cannot be used.
        InstanceError: the daemon's directory is not open to this user.
        RefusedKeyError: the daemon does not list this key.
        SchemaError: the daemon's schema is not known to this client.
        SilenceError: no daemon answers there.
    """
    return DaemonClient(instance, telemetry, control, keys, topics, timeout_s, receive_high_water)


class DaemonClient(Client):
    """A running daemon, made by `connect`: a `Client` that also commands.

    Every command returns when the daemon has answered, and raises `RefusedError` with the reason when it refuses,
    `InstanceError` when no daemon answers, `RefusedKeyError` when the key may not command, and `ClientError` when a
    daemon elsewhere was named without its `control` endpoint. Closing changes nothing at the device: what is armed
    stays armed.
    """

    def __init__(
        self,
        instance: str,
        telemetry: str | None,
        control: str | None,
        keys: Path | str | None,
        topics: Sequence[type[Sent] | Topic | str],
        timeout_s: float | None,
        receive_high_water: int,
    ) -> None:
        if control is not None and telemetry is None:
            raise ClientError(f'{control}: name the same daemon\'s telemetry endpoint as well: telemetry="tcp://..."')
        super().__init__(
            telemetry,
            instance=instance,
            topics=topics,
            timeout_s=timeout_s,
            receive_high_water=receive_high_water,
            keys=keys,
        )
        self._instance = instance
        self._control = control
        self._keys = Path(keys) if keys is not None else None
        self._is_local = telemetry is None
        self._may_command = control is not None or telemetry is None
        try:
            self._join()
        except BaseException:
            self.close()
            raise

    def status(self) -> Status:
        """The daemon's status now.

        Raises:
            SilenceError: the daemon does not answer any more.
        """
        # The daemon says its status to every new subscriber at once.
        with Client(self.endpoint, topics=[Status], keys=self._keys) as asked:
            for record in asked.receive(TIMEOUT_S):
                if isinstance(record, Status):
                    return record
            raise SilenceError(f"{self.endpoint}: no daemon answers{asked.doubt}")

    def arm(self) -> None:
        """Let the daemon apply forces; a wall that is already pressed comes in by a ramp."""
        self._ask("arm")

    def disarm(self) -> None:
        """Ramp the force to zero; returns when the device has let go. Positions go on streaming.

        Raises `RefusedError` where the force may still be there: switch the device off.
        """
        self._ask("disarm", wait=True)

    def calibrate(self) -> None:
        """Calibrate the device, which moves its arm by itself; the daemon must be disarmed.

        Returns when the device is calibrated. Ctrl-C calls it off.
        """
        calibrate(self._instance, self._endpoint(), self._keys)

    def tare(self) -> None:
        """Take the present position as the scene's origin; the daemon must be disarmed, or be ramping the force out."""
        self._ask("tare")

    def clear(self) -> None:
        """Clear the fault that stopped the daemon; it stays disarmed until armed."""
        self._ask("clear")

    def mark(self, text: str) -> None:
        """Put a marker into the event stream, and so into every recording; armed or not.

        Args:
            text: one line of at most 200 printable characters.
        """
        self._ask("mark", text=text)

    def receipt(self) -> dict[str, Any]:
        """What a recording of this daemon says of itself.

        The keys of `hapticd/status`; config_text; device_info, the fields of `DeviceInfo`; kernel, machine and python
        of the daemon's side.
        """
        found: dict[str, Any] = self._ask("receipt")["receipt"]
        return found

    def reload(self) -> None:
        """Have the daemon take its edited file over; returns when the file is in force.

        Raises:
            RefusedConfigError: the file cannot be used, and nothing has changed; the message names every problem.
        """
        self._ask("reload", wait=True)

    def remote(self, name: str, *, scene: str | None = None, state: str | None = None) -> RemotePort:
        """Drive an object, a coupling or a force of the scene; to be used in a `with`.

        Args:
            name: of it, as the configuration has it.
            scene: of a daemon elsewhere, its `remote.scene_tcp` as seen from here.
            state: of a daemon elsewhere, its `remote.state_tcp` as seen from here.

        Raises:
            ClientError: the scene has no such name, or a daemon elsewhere was named without these endpoints.
            RefusedKeyError: the daemon does not list this key, or it may only watch.
            SchemaError: the daemon speaks another version of the protocol.
            SilenceError: the daemon does not answer any more.
        """
        names = self.status().remote_name
        if name not in names:
            there = f"there is {', '.join(names)}" if names else "nothing in it is for clients to drive"
            raise ClientError(f'{self.endpoint}: no "{name}" in the scene: {there}')
        if scene is None or state is None:
            if not self._is_local:
                raise ClientError(
                    f"{self.endpoint}: on another computer name where clients of the scene come in, its "
                    'remote.scene_tcp and remote.state_tcp: scene="tcp://HOST:PORT", state="tcp://HOST:PORT"'
                )
            scene = f"ipc://{locate(SCENE, self._instance)}"
            state = f"ipc://{locate(STATE, self._instance)}"
        return RemotePort(name, scene, state, self._keys)

    def stop(self) -> None:
        """Have the daemon ramp the force out and end. As a service it stays off until it is started again.

        Returns when the force is gone. Raises `RefusedError` where the device did not let go.
        """
        self._ask("stop")

    def _join(self) -> None:
        """Return when the first status is here: from then on the daemon knows of every subscription."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while self.latest_status is None:
            message = self._message(deadline_s)
            if message is None:
                advice = self.doubt or "; start it with `hapticd run`, or name its instance"
                raise SilenceError(f"{self.endpoint}: no daemon answers{advice}")
            self._ahead.extend(message)

    def _ask(self, do: str, **fields: Any) -> dict[str, Any]:
        return command(do, self._instance, connect=self._endpoint(), keys=self._keys, **fields)

    def _endpoint(self) -> str | None:
        if not self._may_command:
            raise ClientError(
                f"{self.endpoint}: only its telemetry was named; to command it, name its control.tcp as well: "
                'control="tcp://HOST:PORT"'
            )
        return self._control
