"""Try what the loop does, in a process as large as it: `python -m hapticd.doctor.trial PRIORITY`."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from dataclasses import asdict

import hapticd.loop.process  # noqa: F401 - the limit counts all memory of a process, so be as large
from hapticd.doctor.attempt import Attempt


def main() -> None:
    """Try, and print how it went."""
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
