"""Lines of the log on their way to the thread that writes them: a terminal that is stopped fills no memory."""

from __future__ import annotations

import logging
import threading
from logging.handlers import QueueHandler
from queue import SimpleQueue

MOST_LINES = 1000
"""How many wait for a terminal or a pipe that takes none (Ctrl-S); later ones are only counted."""

END_S = 2.0
"""How long they may take to be shown when the daemon has ended [s]; what was not shown by then is lost."""


class LogQueue(QueueHandler):
    """Hands lines on and waits for nothing.

    Args:
        lines: where to.
    """

    def __init__(self, lines: SimpleQueue[logging.LogRecord | None]) -> None:
        super().__init__(lines)
        self._lines = lines
        self._lost = 0

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put a line into the queue, and before it how many had no room since the one before."""
        if self._lines.qsize() >= MOST_LINES:
            self._lost += 1
            return
        if self._lost:
            text = f"{self._lost} lines were left out here: what shows them had stopped taking any"
            self._lines.put(logging.makeLogRecord({"msg": text, "levelno": logging.WARNING, "levelname": "WARNING"}))
            self._lost = 0
        self._lines.put(record)


class LogWriter(threading.Thread):
    """Shows lines, and may have to wait for what shows them.

    Args:
        lines: what to show; None is the last.
        handler: shows them.
    """

    def __init__(self, lines: SimpleQueue[logging.LogRecord | None], handler: logging.Handler) -> None:
        super().__init__(name="log", daemon=True)
        self._lines = lines
        self._handler = handler

    def run(self) -> None:
        """Show one after the other."""
        while (record := self._lines.get()) is not None:
            self._handler.handle(record)

    def end(self) -> bool:
        """Show what waits; False where that takes too long: the interpreter could not end without this thread."""
        self._lines.put(None)
        self.join(END_S)
        return not self.is_alive()
