"""Whether the loop could lock its memory and take its priority, tried by a child as large as it."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass

from hapticd.errors import HapticdError

_TIMEOUT_S = 30.0


@dataclass(frozen=True, slots=True)
class Attempt:
    """Outcome of an attempt in a child process.

    Attributes:
        memory: error number of locking all memory, 0 when it could be done.
        scheduling: error number of taking SCHED_FIFO.
    """

    memory: int
    scheduling: int


def attempt(priority: int) -> Attempt:
    """Let a short-lived child try.

    Raises:
        HapticdError: the child did not say.
    """
    command = [sys.executable, "-P", "-m", "hapticd.doctor.trial", str(priority)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=_TIMEOUT_S)
        return Attempt(**json.loads(done.stdout))
    except (subprocess.SubprocessError, ValueError, TypeError) as error:
        raise HapticdError(f"a child that should try it failed: {error}") from error
