"""A daemon and its live view in one terminal: two processes, as they are when a service is watched."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import typer

from hapticd.loop.realtime import die_with_parent

_POLL_S = 0.1
_STOP_TIMEOUT_S = 10.0
_VIEW_TIMEOUT_S = 3.0


def run_watched(config: Path, instance: str) -> int:
    """Start the daemon, show it until the view is closed or the daemon ends, and stop the daemon.

    The daemon's own lines would tear the view apart: they are kept, and printed when it is closed.

    Returns:
        The daemon's exit code; 128 and the signal's number where it was killed, as in a shell.
    """
    hapticd = [sys.executable, "-P", "-m", "hapticd"]
    # When we end in any way, as when the terminal is closed, the daemon ramps its force out and the view ends.
    with_us = partial(die_with_parent, os.getpid())
    with tempfile.TemporaryFile("w+") as log:
        # In a session of its own: the terminal's interrupt closes the view, which then ends the daemon in good order.
        daemon = subprocess.Popen(
            [*hapticd, "run", "--config", str(config), "--instance", instance],
            stderr=log,
            start_new_session=True,
            preexec_fn=with_us,  # noqa: PLW1509 - there is one thread
        )
        view = subprocess.Popen(
            [*hapticd, "watch", "--instance", instance],
            preexec_fn=with_us,  # noqa: PLW1509 - there is one thread
        )
        try:
            with contextlib.suppress(KeyboardInterrupt):
                while view.poll() is None and daemon.poll() is None:
                    time.sleep(_POLL_S)
        finally:
            # The daemon first: a view that a stopped terminal (Ctrl-S) holds up must not keep the force on.
            daemon.send_signal(signal.SIGTERM)
            if view.poll() is None:
                view.send_signal(signal.SIGINT)
            with contextlib.suppress(KeyboardInterrupt):
                _ended(view, _VIEW_TIMEOUT_S)
            code = _ended(daemon, _STOP_TIMEOUT_S)  # killed, its control process releases the device by itself
            log.seek(0)
            typer.echo(log.read(), err=True, nl=False)
    if code < 0:
        name = signal.Signals(-code).name
        typer.echo(f"the daemon was killed ({name}): its control process or a helper takes the force away", err=True)
        return 128 - code
    return code


def _ended(process: subprocess.Popen[bytes], timeout_s: float) -> int:
    """Exit code of a process that was asked to end; one that does not is killed."""
    try:
        return process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
