"""A daemon and its live view in one terminal: two processes, as they are when a service is watched."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import typer

_POLL_S = 0.1
_STOP_TIMEOUT_S = 10.0


def run_watched(config: Path, instance: str) -> int:
    """Start the daemon, show it until the view is closed or the daemon ends, and stop the daemon.

    The daemon's own lines would tear the view apart: they are kept, and printed when it is closed.

    Returns:
        The daemon's exit code.
    """
    hapticd = [sys.executable, "-m", "hapticd"]
    with tempfile.TemporaryFile("w+") as log:
        # In a session of its own: the terminal's interrupt closes the view, which then ends the daemon in good order.
        daemon = subprocess.Popen(
            [*hapticd, "run", "--config", str(config), "--instance", instance], stderr=log, start_new_session=True
        )
        view = subprocess.Popen([*hapticd, "watch", "--instance", instance])
        try:
            with contextlib.suppress(KeyboardInterrupt):
                while view.poll() is None and daemon.poll() is None:
                    time.sleep(_POLL_S)
        finally:
            if view.poll() is None:
                view.send_signal(signal.SIGINT)
            with contextlib.suppress(KeyboardInterrupt):
                view.wait()
            daemon.send_signal(signal.SIGTERM)
            try:
                code = daemon.wait(_STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                daemon.kill()  # its control process releases the device by itself
                code = daemon.wait()
            log.seek(0)
            typer.echo(log.read(), err=True, nl=False)
    return code
