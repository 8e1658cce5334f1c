"""`hapticd run`: the daemon in the foreground."""

from __future__ import annotations

import logging
import os
import signal
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated

import typer

from hapticd.config.loading import load
from hapticd.errors import HapticdError
from hapticd.paths import DEFAULT_INSTANCE, default_config


def run(
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", "-c", help="Configuration file; /etc/hapticd/hapticd.toml or the shipped one if absent."
        ),
    ] = None,
    instance: str = typer.Option(DEFAULT_INSTANCE, "--instance", "-i", help="Name of this daemon, one a device."),
    watch: bool = typer.Option(False, "--watch", help="Show live what it measures; end both with q."),
) -> None:
    """Run the daemon in the foreground until it is interrupted.

    Example: hapticd run --config config/hapticd.toml
    """
    path = config or default_config()
    loaded = load(path)
    if watch:
        from hapticd.cli.watch.attached import run_watched

        raise typer.Exit(run_watched(path, instance))
    from hapticd.supervisor.daemon import Daemon
    from hapticd.supervisor.log_queue import LogQueue, LogWriter
    from hapticd.supervisor.systemd import log_handler

    # Written by a thread: a terminal that is stopped (Ctrl-S) or cut off must not stop the supervisor.
    lines: SimpleQueue[logging.LogRecord | None] = SimpleQueue()
    writer = LogWriter(lines, log_handler())
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[LogQueue(lines)])
    writer.start()
    code = 1
    try:
        code = Daemon(loaded, instance).run()
    except HapticdError as error:
        code = error.exit_code
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # another one would lose the lines that say how it went
        if not writer.end():  # then nor could the interpreter
            os._exit(code)
    raise typer.Exit(code)
