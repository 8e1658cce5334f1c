"""A few seconds of one loop and of the C program that watches it: the blocks of `hapticd bench lateness`."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from hapticd.errors import HapticdError, RealtimeError
from hapticd.measure import MachineWatch
from hapticd_bench.compiling import compile_c
from hapticd_bench.threaded import serve_threaded
from hapticd_bench.tick import RecordedLoop, scene, serve_daemon

Loop = Literal["C", "daemon", "thread"]
Load = Literal["idle", "burners"]

PERIOD_NS = 1_000_000
WITNESS_PRIORITY = 90
LOOP_PRIORITY = 80

_SETTLE_S = 0.3
_MARGIN_S = 1.2
_SOURCE = Path(__file__).with_name("witness.c")
_BURN = "import sys, time\nend = time.monotonic() + float(sys.argv[1])\nwhile time.monotonic() < end: pass"
_GRANT = (
    "  this benchmark needs SCHED_FIFO 90, locked memory and /dev/cpu_dma_latency: run it as root, or grant\n"
    "  CAP_SYS_NICE and CAP_IPC_LOCK (or rtprio 90 and memlock unlimited in /etc/security/limits.d) and the device file"
)


@dataclass(frozen=True, slots=True)
class Block:
    """A few seconds of one loop and its witness.

    Attributes:
        late_us: deadline to lateness of the loop [ns to us].
        witness_us: the same of the witness.
        loop_skipped, witness_skipped: deadlines that each had to skip.
        busy_us: bodies of the loop's ticks, empty for the C loop [us].
        others: processors that programs which have no part in this kept busy.
    """

    late_us: Mapping[int, float]
    witness_us: Mapping[int, float]
    loop_skipped: int
    witness_skipped: int
    busy_us: Sequence[float] = ()
    others: float = 0.0


def compile_witness(directory: Path) -> Path:
    """Compile the C program into a directory.

    Raises:
        HapticdError: there is no compiler, or it refuses.
    """
    return compile_c(_SOURCE, directory / "witness")


def check_rights(witness: Path, cpu: int) -> None:
    """Let the witness try whether this process may do what has to be done.

    Raises:
        RealtimeError: it may not; says what to grant.
    """
    command = [str(witness), str(cpu), str(WITNESS_PRIORITY), "1", os.devnull]
    tried = subprocess.run(command, capture_output=True, text=True, check=False)
    if tried.returncode:
        raise RealtimeError(f"the witness cannot run: {tried.stderr.strip()}\n{_GRANT}")


def run_block(witness: Path, cpu: int, loop: Loop, load: Load, seconds: float, machine: MachineWatch) -> Block:
    """Run a loop and its witness side by side; half-way, look whether another real-time program is there.

    Raises:
        HapticdError: one of them did not run.
    """
    block_watch = MachineWatch()
    with ExitStack() as stack, tempfile.TemporaryDirectory(prefix="hapticd-bench-") as directory:
        if load == "burners":
            stack.enter_context(_burners(60.0 + seconds))
        running = _CLoop(witness, cpu, seconds) if loop == "C" else _PythonLoop(loop, cpu)
        stack.callback(running.close)
        # The witness covers every tick that counts: those from `_SETTLE_S` after its start on, for `seconds`.
        file = Path(directory) / "witness"
        watching = _start(witness, cpu, WITNESS_PRIORITY, _SETTLE_S + seconds + _MARGIN_S, file)
        stack.callback(_end, watching)
        time.sleep((_SETTLE_S + seconds) / 2)
        machine.look()
        time.sleep((_SETTLE_S + seconds) / 2)
        late_us, busy_us = running.stop()
        _wait(watching)
        block = cut(late_us, read_pairs(file), busy_us, seconds)
    return replace(block, others=block_watch.end().others)


def read_pairs(file: Path) -> dict[int, float]:
    """Deadline to lateness, as the C program wrote them [ns to us]."""
    values = array("q", file.read_bytes())
    return {deadline_ns: late_ns * 1e-3 for deadline_ns, late_ns in zip(values[::2], values[1::2], strict=True)}


def cut(
    late_us: Mapping[int, float], witness_us: Mapping[int, float], busy_us: Mapping[int, float], seconds: float
) -> Block:
    """The part of two records in which both have settled; `seconds` of deadlines.

    Raises:
        HapticdError: the loop did not run in that time.
    """
    start_ns = min(witness_us) + round(_SETTLE_S * 1e9)
    end_ns = start_ns + round(seconds * 1e9)
    if not late_us or min(late_us) > start_ns:
        raise HapticdError("the loop was not there when its witness was")
    end_ns = min(end_ns, max(late_us) + PERIOD_NS)
    expected = (end_ns - start_ns) // PERIOD_NS
    loop = {deadline: value for deadline, value in late_us.items() if start_ns <= deadline < end_ns}
    seen = {deadline: value for deadline, value in witness_us.items() if start_ns <= deadline < end_ns}
    busy = [value for deadline, value in busy_us.items() if start_ns <= deadline < end_ns]
    return Block(loop, seen, expected - len(loop), expected - len(seen), busy)


class _CLoop:
    """The C program in the place of the loop."""

    def __init__(self, witness: Path, cpu: int, seconds: float) -> None:
        self._directory = tempfile.TemporaryDirectory(prefix="hapticd-bench-")
        self._file = Path(self._directory.name) / "loop"
        self._process = _start(witness, cpu, LOOP_PRIORITY, seconds + _SETTLE_S + _MARGIN_S, self._file)

    def close(self) -> None:
        """End it, whatever it does."""
        _end(self._process)
        self._directory.cleanup()

    def stop(self) -> tuple[dict[int, float], dict[int, float]]:
        """Wait for its end.  -> deadline to lateness, deadline to body; it has no body."""
        _wait(self._process)
        return read_pairs(self._file), {}


class _PythonLoop:
    """The daemon, or the layout that it does not have, with a heavy publisher."""

    def __init__(self, loop: Loop, cpu: int) -> None:
        table = f'realtime = "required"\npriority = {LOOP_PRIORITY}\ncpu = {cpu}'
        serve = serve_daemon if loop == "daemon" else serve_threaded
        self._loop = RecordedLoop(serve, scene(loop=table), heavy=True)

    def close(self) -> None:
        """End it, whatever it does."""
        self._loop.kill()

    def stop(self) -> tuple[dict[int, float], dict[int, float]]:
        """End it.  -> deadline to lateness, deadline to body [ns to us]."""
        ticks = self._loop.stop()
        if ticks.fault:
            raise HapticdError(f"the measured loop stopped: {ticks.fault}")
        late_us = dict(zip(ticks.deadline_ns, ticks.late_us, strict=True))
        return late_us, dict(zip(ticks.deadline_ns, ticks.busy_us, strict=True))


@contextmanager
def _burners(seconds: float) -> Iterator[None]:
    """Two programs that compute; they end by themselves if they are not ended."""
    burners = [subprocess.Popen([sys.executable, "-c", _BURN, str(seconds)]) for _ in range(2)]
    try:
        yield
    finally:
        for burner in burners:
            _end(burner)


def _start(witness: Path, cpu: int, priority: int, seconds: float, file: Path) -> subprocess.Popen[str]:
    """Start the C program and wait until it is about to sleep to its first deadline."""
    ticks = round(seconds * 1e9) // PERIOD_NS
    process = subprocess.Popen(
        [str(witness), str(cpu), str(priority), str(ticks), str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    if process.stdout.readline() != "ready\n":
        _wait(process)
    return process


def _wait(process: subprocess.Popen[Any]) -> None:
    _, errors = process.communicate(timeout=60.0)
    if process.returncode:
        raise HapticdError(f"the witness failed: {errors.strip()}")


def _end(process: subprocess.Popen[Any]) -> None:
    process.kill()
    process.wait()
