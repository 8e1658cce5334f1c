"""How files of tests are dealt out to the workers of a run: the longest first, and what waits to a worker of its own.

A worker that waits for daemons in real time leaves its processor to the others. So where there are enough workers, the
last is given files that mostly wait and, when there are no more of them, nothing: no more workers than before compute
at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

TOGETHER = {"tests/studies/test_paper_claims.py": "tests/studies/test_paper.py"}
"""Files that one worker is to run, since they share what takes long to compute."""

WAITING = (
    "tests/service/test_systemd.py",
    "tests/daemon/test_faults.py",
    "tests/daemon/test_verdicts.py",
    "tests/daemon/test_edited.py",
    "tests/daemon/test_space_presses.py",
    "tests/daemon/test_flood.py",
    "tests/views/dashboard/test_floods.py",
    "tests/cli/test_watch.py",
    "tests/drivers/odrive/test_daemon.py",
    "tests/drivers/moteus/test_daemon.py",
    "tests/daemon/test_commands.py",
    "tests/drivers/haply/test_faults.py",
    "tests/service/test_package.py",  # in the machine of test_systemd.py, which has one user at a time
    "tests/daemon/test_saving.py",
    "tests/daemon/test_deaths.py",
    "tests/benchmarks/test_soak.py",
    "tests/views/recording/test_recorder.py",
    "tests/drivers/odrive/test_faults.py",
    "tests/drivers/moteus/test_faults.py",
    "tests/drivers/rig/test_serial_daemon.py",
)
"""Files that mostly wait, in the order in which they are begun; the longest first."""

FROM_WORKERS = 4
"""With fewer there is none for what waits."""


class Dealing(LoadFileScheduling):  # type: ignore[misc]  # xdist publishes no types
    """Deals out whole files, in their order.

    Args:
        config: pytest's.
        log: xdist's.
        waiting: files for the worker that waits.
        together: a file to one that its worker is to run as well.
    """

    def __init__(
        self,
        config: pytest.Config,
        log: Producer | None = None,
        waiting: Sequence[str] = WAITING,
        together: Mapping[str, str] = TOGETHER,
    ) -> None:
        super().__init__(config, log)
        self._together = together
        self._waiting = waiting if self.numnodes >= FROM_WORKERS else ()
        self._waiter = f"gw{self.numnodes - 1}" if self._waiting else ""

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return self._together.get(file, file)

    def _reschedule(self, node: WorkerController) -> None:
        if node.gateway.id == self._waiter and not self._left() and not node.shutting_down:
            node.shutdown()
        else:
            super()._reschedule(node)

    def _assign_work_unit(self, node: WorkerController) -> None:
        """The next file becomes the first in the queue; what waits is the last that others are given."""
        left = self._left()
        if node.gateway.id == self._waiter and left:
            self.workqueue.move_to_end(left[0], last=False)
        else:
            for file in left:
                self.workqueue.move_to_end(file)
        super()._assign_work_unit(node)

    def _left(self) -> list[str]:
        """Files that wait and have not been begun."""
        return [file for file in self._waiting if file in self.workqueue]
