"""Log lines that nothing takes: bounded, and counted once there is room again."""

from __future__ import annotations

import logging
import os
import subprocess
from pathlib import Path
from queue import SimpleQueue

import msgpack
import zmq

from hapticd.supervisor.log_queue import MOST_LINES, LogQueue
from tests.daemon.running import HAPTICD, PATIENCE_S, wait_until


def shown(lines: SimpleQueue[logging.LogRecord | None]) -> list[str]:
    waiting = [lines.get() for _ in range(lines.qsize())]
    return [record.getMessage() for record in waiting if record is not None]


def test_of_lines_that_no_one_takes_some_wait_and_the_others_are_counted() -> None:
    """They filled the memory: 2 MB a second while a client marked, until the bound on it disconnected every client."""
    lines: SimpleQueue[logging.LogRecord | None] = SimpleQueue()
    log = logging.Logger("test")
    log.addHandler(LogQueue(lines))
    for number in range(MOST_LINES + 500):
        log.info("line %d", number)
    assert lines.qsize() == MOST_LINES
    assert shown(lines)[-1] == f"line {MOST_LINES - 1}"
    log.info("again")
    log.info("and again")
    assert shown(lines) == [
        "500 lines were left out here: what shows them had stopped taking any",
        "again",
        "and again",
    ]


def test_a_daemon_whose_terminal_is_stopped_stays_as_large_as_it_is_and_ends_when_it_is_to(tmp_path: Path) -> None:
    reads, writes = os.pipe()
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(tmp_path), "HAPTICD_STATE_DIR": str(tmp_path)}
    (tmp_path / "lab.toml").touch()
    command = [HAPTICD, "run", "--config", str(tmp_path / "lab.toml")]
    with (
        subprocess.Popen(command, env=environment, stderr=writes) as daemon,
        zmq.Context() as context,
        context.socket(zmq.DEALER) as client,
    ):
        try:
            wait_until((tmp_path / "default" / "control").exists, "the daemon")
            client.connect(f"ipc://{tmp_path}/default/control")
            client.setsockopt(zmq.RCVTIMEO, 60_000)

            def marked(count: int) -> int:
                for _ in range(count // 50):
                    for _ in range(50):
                        client.send(msgpack.packb({"do": "mark", "text": "x" * 200}))
                    assert all(msgpack.unpackb(client.recv())["ok"] for _ in range(50))
                said = Path(f"/proc/{daemon.pid}/status").read_text()
                return int(said.partition("RssAnon:")[2].split()[0])  # without the ring, which fills by itself

            full = marked(1000)
            assert marked(5000) - full < 6_000, "5000 marks took 11 MB more"
            daemon.terminate()
            assert daemon.wait(PATIENCE_S) == 0, "its device is free, and its last lines are lost"
        finally:
            os.close(reads)
            os.close(writes)
            daemon.kill()
