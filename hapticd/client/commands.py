"""Ask a running daemon to do something: what `hapticd arm`, `disarm`, `reload` and their like are made of."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.errors import EndpointError, HapticdError, InstanceError, SilenceError
from hapticd.keys.client import ENVIRONMENT, CurveClient, RefusedKeyError, client_keys
from hapticd.paths import CONTROL, DEFAULT_INSTANCE, alive, locate

TIMEOUT_S = 5.0
"""How long a daemon may take to answer, and to begin with what it was asked [s]."""

GRACE_S = 1.0
"""How long the answer that a request came too late may take [s]."""

STOP_TIMEOUT_S = 15.0
"""How long a daemon may take to end its loop, and to see that the force is gone where its driver hangs [s]."""

CALIBRATION_TIMEOUT_S = 120.0
"""How long a device may take to calibrate [s]."""

_LOOK_S = 0.1  # how often it is seen whether the daemon is still there

_LATER = ("arm", "calibrate", "tare", "clear")  # what may have to wait, and must not be done when it is too late


class RefusedError(HapticdError):
    """The daemon understood the request and refused it; the message says why."""


class RefusedConfigError(RefusedError):
    """The daemon refused a configuration file."""

    exit_code = 2


def command(
    do: str,
    instance: str = DEFAULT_INSTANCE,
    timeout_s: float | None = None,
    connect: str | None = None,
    keys: Path | None = None,
    **fields: bool | float | str,
) -> dict[str, Any]:
    """Send one request and wait for its answer.

    What the daemon could not begin within `TIMEOUT_S` it never does. A verdict on a configuration is waited for as
    long as the daemon lives.

    Args:
        do: `status`, `receipt`, `arm`, `disarm`, `calibrate`, `tare`, `clear`, `mark`, `reload` or `stop`.
        instance: which daemon on this computer, when no endpoint is given.
        timeout_s: how long the daemon may be silent [s]; None: `TIMEOUT_S`, to stop `STOP_TIMEOUT_S`.
        connect: the daemon's `control.tcp` as seen from here, such as "tcp://lab.example:9873".
        keys: key file for it; None: the one that $HAPTICD_KEYS names.
        fields: what else belongs to the request: the `text` of `mark`; `wait=True` makes `reload` answer with its
            verdict.

    Returns:
        The answer: `ok`, `text`, and for `status` the fields of `hapticd/status` under `status`, for `receipt` what a
        recording says of itself under `receipt`.

    Raises:
        ConfigError: the key file cannot be used.
        EndpointError: ZeroMQ cannot use the endpoint.
        InstanceError: no daemon answers there, it ended before it answered, or two daemons of this name run.
        RefusedKeyError: commands over TCP take a key that the daemon lists.
        RefusedError: it answers that it will not.
    """
    if timeout_s is None:
        timeout_s = STOP_TIMEOUT_S if do == "stop" else TIMEOUT_S
    if connect is None:
        place = locate(CONTROL, instance)
        endpoint = f"ipc://{place}"
        if not alive(place.parent):
            raise InstanceError(f"no daemon answers on {endpoint}: start it with `hapticd run`, or name its --instance")
    else:
        endpoint = connect
    own = client_keys(endpoint, keys)
    if own is None and endpoint.startswith("tcp://"):
        raise RefusedKeyError(
            f"{endpoint}: commands over TCP take keys: name your key file with --keys or ${ENVIRONMENT}"
        )
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    connection = CurveClient(socket, endpoint, own)
    try:
        connection.connect()
        talk = _Talk(socket, connection, timeout_s)
        request: dict[str, Any] = {"do": do, **fields}
        if do in _LATER:
            request["by_ns"] = talk.clock_ns(local=connect is None) + int(min(timeout_s, TIMEOUT_S) * 1e9)
        answer = talk.ask(request)
    except zmq.ZMQError as error:
        why = zmq.strerror(error.errno or 0)
        raise EndpointError(f"{endpoint}: {why}; an endpoint is tcp://HOST:PORT or ipc://PATH") from error
    except SilenceError as error:
        if connect is None or connection.connected:
            text = f"{endpoint}: a daemon runs there and does not answer; what it does is in its log"
            late = f"; what it has not begun by now ({do}) it will not do" if do in _LATER else ""
            raise InstanceError(text + late) from error
        raise InstanceError(
            f"no daemon answers on {endpoint}{connection.doubt or ': is it its control.tcp?'}"
        ) from error
    finally:
        connection.close()
        context.term()
    if not answer["ok"]:
        raise (RefusedConfigError if do == "reload" else RefusedError)(answer["text"])
    return answer


class _Talk:
    """Requests and their answers, one at a time."""

    def __init__(self, socket: zmq.Socket[bytes], connection: CurveClient, timeout_s: float) -> None:
        self._socket = socket
        self._connection = connection
        self._timeout_s = timeout_s

    def clock_ns(self, *, local: bool) -> int:
        """CLOCK_MONOTONIC of the daemon when this was called, or earlier [ns].

        Args:
            local: it is the one of this computer.

        Raises:
            InstanceError: the daemon is of another version and does not tell.
            SilenceError: no answer.
        """
        asked_ns = time.monotonic_ns()
        if local:
            return asked_ns
        answer = self.ask({"do": "status"})
        if "clock_ns" not in answer:
            raise InstanceError(
                f"hapticd {answer['status'].get('version')} there is too old for this client: upgrade it"
            )
        return int(answer["clock_ns"]) - (time.monotonic_ns() - asked_ns)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request.

        Raises:
            InstanceError: none will come.
            RefusedError: a text of it is no UTF-8.
            SilenceError: none came, or for a verdict on a configuration not even a sign of life.
        """
        try:
            self._socket.send(msgpack.packb(request))
        except UnicodeEncodeError:
            raise RefusedError(f"{request['do']}: a text that is no UTF-8 cannot be sent") from None
        patient = request["do"] == "reload"
        silent = False
        while True:
            if self._wait(request["do"]):
                answer: dict[str, Any] = msgpack.unpackb(self._socket.recv(), unicode_errors="surrogateescape")
                if patient and "status" in answer:
                    silent = False
                    continue
                return answer
            if not patient or silent:
                raise SilenceError("no answer")
            silent = True
            self._socket.send(msgpack.packb({"do": "status"}))

    def _wait(self, do: str) -> bool:
        """Whether a message has come in time; a daemon that has ended is not waited for.

        Raises:
            InstanceError: none will come.
        """
        until_s = time.monotonic() + self._timeout_s + GRACE_S
        while (left_s := until_s - time.monotonic()) > 0.0:
            if self._connection.wait(min(left_s, _LOOK_S)):
                return True
            if self._connection.lost and not self._connection.wait(GRACE_S) and self._connection.lost:
                force = " and what became of the force" if do in ("disarm", "stop") else ""
                raise InstanceError(
                    f"{do}: the daemon ended, or its connection, before it answered; its log says why{force}"
                )
        return False


def calibrate(instance: str = DEFAULT_INSTANCE, connect: str | None = None, keys: Path | None = None) -> None:
    """Calibrate the device, which moves its arm by itself; an interrupt calls it off.

    Args:
        instance: which daemon on this computer, when no endpoint is given.
        connect: the daemon's `control.tcp` as seen from here.
        keys: key file for it; None: the one that $HAPTICD_KEYS names.

    Raises:
        ConfigError, InstanceError, RefusedKeyError, RefusedError: as `command`, or it could not be called off.
        KeyboardInterrupt: it was called off.
    """
    try:
        command("calibrate", instance, CALIBRATION_TIMEOUT_S, connect, keys)
    except KeyboardInterrupt:
        try:
            command("disarm", instance, connect=connect, keys=keys)
        except HapticdError as error:
            raise InstanceError(f"not called off: {error}; if the arm still moves, switch the device off") from error
        raise
