"""Ask a running daemon to do something: what `hapticd arm`, `disarm`, `reload` and their like are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgpack
import zmq

from hapticd.errors import HapticdError, InstanceError
from hapticd.keys.client import ENVIRONMENT, CurveClient, RefusedKeyError, client_keys
from hapticd.paths import CONTROL, DEFAULT_INSTANCE, locate

TIMEOUT_S = 5.0
"""How long a daemon may take to answer [s]."""

CALIBRATION_TIMEOUT_S = 120.0
"""How long a device may take to calibrate [s]."""


class RefusedError(HapticdError):
    """The daemon understood the request and refused it; the message says why."""


class RefusedConfigError(RefusedError):
    """The daemon refused a configuration file."""

    exit_code = 2


def command(
    do: str,
    instance: str = DEFAULT_INSTANCE,
    timeout_s: float = TIMEOUT_S,
    connect: str | None = None,
    keys: Path | None = None,
    **fields: bool | float | str,
) -> dict[str, Any]:
    """Send one request and wait for its answer.

    Args:
        do: `status`, `arm`, `disarm`, `calibrate`, `tare`, `clear`, `reload` or `stop`.
        instance: which daemon on this computer, when no endpoint is given.
        timeout_s: how long to wait for it [s].
        connect: the daemon's `control.tcp` as seen from here, such as "tcp://lab.example:9873".
        keys: key file for it; None: the one that $HAPTICD_KEYS names.
        fields: what else belongs to the request; `wait=True` makes `reload` answer with its verdict.

    Returns:
        The answer: `ok`, `text`, and for `status` the fields of `hapticd/status` under `status`.

    Raises:
        ConfigError: the key file cannot be used.
        InstanceError: no daemon answers there.
        RefusedKeyError: commands over TCP take a key that the daemon lists.
        RefusedError: it answers that it will not.
    """
    endpoint = connect or f"ipc://{locate(CONTROL, instance)}"
    own = client_keys(endpoint, keys)
    if own is None and endpoint.startswith("tcp://"):
        raise RefusedKeyError(
            f"{endpoint}: commands over TCP take keys: name your key file with --keys or ${ENVIRONMENT}"
        )
    advice = "is it its control.tcp?" if connect else "start it with `hapticd run`, or name its --instance"
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    connection = CurveClient(socket, endpoint, own)
    try:
        connection.connect()
        socket.send(msgpack.packb({"do": do, **fields}))
        if not connection.wait(timeout_s):
            raise InstanceError(f"no daemon answers on {endpoint}{connection.doubt or f': {advice}'}")
        answer: dict[str, Any] = msgpack.unpackb(socket.recv())
    except zmq.ZMQError as error:
        why = zmq.strerror(error.errno or 0)
        raise InstanceError(f"{endpoint}: {why}; an endpoint is tcp://HOST:PORT or ipc://PATH") from error
    finally:
        connection.close()
        context.term()
    if not answer["ok"]:
        raise (RefusedConfigError if do == "reload" else RefusedError)(answer["text"])
    return answer


def calibrate(instance: str = DEFAULT_INSTANCE, connect: str | None = None, keys: Path | None = None) -> None:
    """Calibrate the device, which moves its arm by itself; an interrupt calls it off.

    Args:
        instance: which daemon on this computer, when no endpoint is given.
        connect: the daemon's `control.tcp` as seen from here.
        keys: key file for it; None: the one that $HAPTICD_KEYS names.

    Raises:
        ConfigError, InstanceError, RefusedKeyError, RefusedError: as `command`.
        KeyboardInterrupt: it was called off.
    """
    try:
        command("calibrate", instance, CALIBRATION_TIMEOUT_S, connect, keys)
    except KeyboardInterrupt:
        command("disarm", instance, connect=connect, keys=keys)
        raise
