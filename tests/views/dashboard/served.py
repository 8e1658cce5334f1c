"""`hapticd dashboard` in a process of its own, for a daemon or a publisher of the test."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

from tests.daemon.running import HAPTICD
from tests.ports import free_port


class Served:
    """A dashboard that can be opened.

    Args:
        runtime: $HAPTICD_RUNTIME_DIR of the daemon.
        arguments: of the command besides the port.
        prefix: what comes before the command.
    """

    def __init__(self, runtime: Path, *arguments: str, prefix: Sequence[str] = ()) -> None:
        self.port = free_port()
        self.process = subprocess.Popen(
            [*prefix, HAPTICD, "dashboard", "--port", str(self.port), *arguments],
            env={**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert self.process.stdout is not None
        said = [self.process.stdout.readline(), self.process.stdout.readline()]
        addresses = re.findall(r"http://\S+", "".join(said))
        assert len(addresses) == 2, said + self.process.stdout.readlines()
        self.watch, self.command = addresses
        self.token = self.command.partition("#token=")[2]

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.communicate(timeout=30)

    def cpu_s(self) -> float:
        """Processor time that it has used."""
        times = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
        return sum(map(int, times)) / os.sysconf("SC_CLK_TCK")

    def memory_kb(self) -> int:
        """Memory that it has resident."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.findall(r"VmRSS:\s+(\d+)", status)[0])
