"""Control processes whose supervisor has died: killed where they do not end by themselves."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from hapticd.supervisor.child import END_TIMEOUT_S, KILL_TIMEOUT_S


def kill_orphans(supervisor_pid: int) -> bool:
    """Leave the loops of a dead supervisor the time to let go, which they do at its death; kill those that do not.

    One that is stopped, or hangs in a driver or a law, does not notice.

    Args:
        supervisor_pid: who started them.

    Returns:
        Whether one had to be killed, so that its force may still be there.
    """
    time.sleep(END_TIMEOUT_S)  # first: to look for them takes a processor, which they may need for their ramp
    orphans = list(_loops_of(supervisor_pid))
    for orphan in orphans:
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(orphan, signal.SIGKILL)
    gone_by_s = time.monotonic() + KILL_TIMEOUT_S  # one that waits inside the kernel for its hardware stays
    for orphan in orphans:
        waiting = select.poll()
        waiting.register(orphan, select.POLLIN)
        waiting.poll(1e3 * max(0.0, gone_by_s - time.monotonic()))
        os.close(orphan)
    return bool(orphans)


def _loops_of(supervisor_pid: int) -> Iterator[int]:
    """Descriptors of the processes: a number may be another's by the time at which a signal is sent to it."""
    parent = f"\0--parent\0{supervisor_pid}\0".encode()
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has just ended
            process = os.pidfd_open(int(entry.name))
            try:
                command = (entry / "cmdline").read_bytes()
                theirs = b"\0hapticd.loop.process\0" in command and parent in command
            except OSError:
                theirs = False
            if theirs:
                yield process
            else:
                os.close(process)
