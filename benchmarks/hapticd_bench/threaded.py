"""The layout that hapticd does not have: telemetry as a thread of the loop's own interpreter.

The negative control of `hapticd_bench.lateness`. The loop, its set-up and what the publisher does are the daemon's;
only the second process is missing. A harness that lets this pass measures nothing.
"""

from __future__ import annotations

import os
import signal
import tempfile
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

from hapticd.config.loading import parse
from hapticd.config.walls import MAX_WALLS
from hapticd.errors import HapticdError
from hapticd.loop.loop import ControlLoop
from hapticd.loop.memory import SUPERVISOR_BEAT, SharedMemory
from hapticd.loop.realtime import become_realtime, die_with_parent, sleep_until
from hapticd.supervisor.daemon import DRAIN_S
from hapticd.telemetry.clock import measure_epoch_offset_ns
from hapticd.telemetry.publisher import Publisher
from hapticd.tick.assemble import make_tick, place_device
from hapticd.tick.record import RecordLayout
from hapticd_bench.tick import KeptRecords


def serve_threaded(connection: Connection, text: str, heavy: bool) -> None:
    """Run loop and publisher in this process until SIGTERM; as `hapticd_bench.tick.serve_daemon`."""
    die_with_parent(os.getppid())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        config = parse(text, "benchmark")
        settings = config.config
        driver = config.make_driver()
        place_device(config, driver)
        info = driver.open()
        layout = RecordLayout(len(info.axes), info.has_orientation, MAX_WALLS)
        shared = SharedMemory(layout, settings.loop.rate_hz)
        kept = KeptRecords(shared, heavy)
        control = ControlLoop(
            driver, make_tick(config, info), shared, settings.loop, settings.safety, True, sleep_until
        )
        done = threading.Event()

        def publish() -> None:
            with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as runtime:
                path = Path(runtime) / "telemetry"
                publisher = Publisher(settings.telemetry, path, info, measure_epoch_offset_ns())
                told = False
                while not done.is_set():
                    shared.words[SUPERVISOR_BEAT] = time.monotonic_ns()
                    publisher.publish(kept.read())
                    publisher.flush(time.monotonic_ns())
                    if kept.ticks.seq and not told:
                        told = True
                        connection.send(None)
                    time.sleep(DRAIN_S)
                publisher.close()

        def stop(_signal: int, _frame: object) -> None:
            control.session.stop_requested = True

        signal.signal(signal.SIGTERM, stop)
        shared.words[SUPERVISOR_BEAT] = time.monotonic_ns()
        # The class of the loop's thread is its own, so the publisher's stays at normal priority.
        publishing = threading.Thread(target=publish)
        publishing.start()
        try:
            problems, advice = become_realtime(settings.loop)
            kept.ticks.warnings = tuple(problems + advice)
            control.run()
        finally:
            done.set()
            publishing.join()
        kept.ticks.dropped = kept.dropped
        kept.ticks.fault = control.session.tick.fault_text
        connection.send(kept.ticks)
    except HapticdError as error:
        connection.send(HapticdError(str(error)))
