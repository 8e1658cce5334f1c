"""Ask a running daemon to do something: what `hapticd arm`, `disarm`, `clear` and `reload` are made of."""

from __future__ import annotations

from typing import Any

import msgpack
import zmq

from hapticd.contracts.errors import HapticdError, InstanceError
from hapticd.telemetry.endpoint import CONTROL, DEFAULT_INSTANCE, locate

TIMEOUT_S = 5.0
"""How long a daemon may take to answer [s]."""


class RefusedError(HapticdError):
    """The daemon understood the request and refused it; the message says why."""


class RefusedConfigError(RefusedError):
    """The daemon refused a configuration file."""

    exit_code = 2


def command(
    do: str, instance: str = DEFAULT_INSTANCE, timeout_s: float = TIMEOUT_S, **fields: bool | float | str
) -> dict[str, Any]:
    """Send one request and wait for its answer.

    Args:
        do: `status`, `arm`, `disarm`, `clear`, `reload` or `stop`.
        instance: which daemon.
        timeout_s: how long to wait for it [s].
        fields: what else belongs to the request; `wait=True` makes `reload` answer with its verdict.

    Returns:
        The answer: `ok`, `text`, and for `status` the fields of `hapticd/status` under `status`.

    Raises:
        InstanceError: no daemon answers there.
        RefusedError: it answers that it will not.
    """
    path = locate(CONTROL, instance)
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    try:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(f"ipc://{path}")
        socket.send(msgpack.packb({"do": do, **fields}))
        if not socket.poll(int(timeout_s * 1e3)):
            raise InstanceError(
                f"no daemon answers on ipc://{path}: start it with `hapticd run`, or name its --instance"
            )
        answer: dict[str, Any] = msgpack.unpackb(socket.recv())
    finally:
        socket.close()
        context.term()
    if not answer["ok"]:
        raise (RefusedConfigError if do == "reload" else RefusedError)(answer["text"])
    return answer
