"""A one-axis rig on a serial port that speaks lines of text: `Board` is what you replace by your device's own."""

from collections.abc import Sequence

import serial

from hapticd.driver import DeviceInfo, Driver, DriverOptions, Field, Sample
from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DeviceProtocolError, DeviceTimeoutError


class Board:
    """The device's own protocol: a line each way; your vendor's library may stand here instead.

    Args:
        port: the serial port.
        timeout_s: how long an answer may take [s].

    Raises:
        DeviceNotFoundError: the port cannot be opened.
    """

    def __init__(self, port: str, timeout_s: float) -> None:
        try:
            self._line = serial.Serial(port, 115200, timeout=timeout_s, write_timeout=timeout_s)
        except serial.SerialException as error:
            raise DeviceNotFoundError(f"{port}: {error}; is the rig plugged in?") from error

    def tell(self, command: str) -> None:
        """Send a command that has no answer."""
        try:
            self._line.write(command.encode() + b"\n")
        except serial.SerialException as error:
            raise DeviceDisconnectedError(f"the rig is gone: {error}") from error

    def ask(self, command: str) -> str:
        """Send a command and wait for its answer."""
        self.tell(command)
        try:
            answer = bytes(self._line.readline())
        except serial.SerialException as error:
            raise DeviceDisconnectedError(f"the rig is gone: {error}") from error
        if not answer.endswith(b"\n"):
            raise DeviceTimeoutError(f"the rig did not answer {command!r} in time")
        return answer.decode("ascii", "replace").strip()

    def close(self) -> None:
        """Give the port back."""
        self._line.close()


class MyRigOptions(DriverOptions):
    """The keys of [device.options]."""

    port: str = Field("/dev/ttyACM0", description="serial port of the rig")
    counts_per_m: float = Field(1e5, gt=0.0, le=1e9, description="counts of the encoder to a metre [1/m]")


class MyRig(Driver[MyRigOptions]):
    """The rig of our lab."""

    Options = MyRigOptions

    def _open(self) -> DeviceInfo:
        """Find it, greet it, learn what it is; no force, no motion."""
        self._sample = Sample(1)
        self._board = Board(self.options.port, timeout_s=0.5 * self.period_s)
        greeting = self._board.ask("hello")
        if not greeting.startswith("my-rig "):
            raise DeviceProtocolError(f"{self.options.port}: {greeting!r} is no rig of ours")
        return DeviceInfo(
            model="my rig",
            serial=greeting.removeprefix("my-rig "),
            axes=("x",),
            max_force_n=5.0,  # the guard keeps every force below this
            resolution_m=1.0 / self.options.counts_per_m,
            workspace_m=((-0.05, 0.05),),
            nominal_rate_hz=1000.0,
            safe_damping_n_s_per_m=2.0,  # a digital damper of this size is stable on this device
            host_silence_ms=50.0,  # only when the firmware really lets go by itself after that; otherwise None
        )

    def _enable(self) -> None:
        """Allow forces; the first one is zero."""
        self._board.tell("force 0")
        self._board.tell("enable")

    def _read(self) -> Sample:
        """The newest position; never waits longer than the tick allows."""
        answer = self._board.ask("position")
        try:
            self._sample.position_m[0] = int(answer) / self.options.counts_per_m
        except ValueError:
            raise DeviceProtocolError(f"the rig says {answer!r} where a position should be") from None
        return self._sample

    def _write(self, force_n: Sequence[float]) -> None:
        """Apply a force; it is finite, within the limit, one element an axis."""
        self._board.tell(f"force {round(1000.0 * force_n[0])}")  # in millinewtons

    def _disable(self) -> None:
        """No force: from any state, twice, after an error."""
        self._board.tell("disable")

    def _close(self) -> None:
        """Give back what `_open` took, even half of it."""
        if hasattr(self, "_board"):
            self._board.close()
