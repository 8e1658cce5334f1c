"""Try what the control process does, in a child as large as it: `python -m hapticd.doctor.attempt PRIORITY`."""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass

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
    command = [sys.executable, "-m", "hapticd.doctor.attempt", str(priority)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=_TIMEOUT_S)
        return Attempt(**json.loads(done.stdout))
    except (subprocess.SubprocessError, ValueError, TypeError) as error:
        raise HapticdError(f"a child that should try it failed: {error}") from error


def main() -> None:
    """Try, and print how it went."""
    import hapticd.loop.process  # noqa: F401 - the limit counts all memory of a process, so be as large

    libc = ctypes.CDLL(None, use_errno=True)
    memory = ctypes.get_errno() if libc.mlockall(1 | 2) else 0
    scheduling = 0
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(int(sys.argv[1])))
    except OSError as error:
        scheduling = error.errno or -1
    sys.stdout.write(json.dumps(asdict(Attempt(memory, scheduling))))


if __name__ == "__main__":
    main()
