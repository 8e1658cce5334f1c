"""Isaac Lab's client in a process, from the wheel that `make test` fetches."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
WHEELS = sorted((ROOT / ".venv" / "clients").glob("isaaclab-*.whl"))


class Isaac:
    """The client, connected.

    Args:
        url: of the gateway.
    """

    def __init__(self, url: str) -> None:
        if not WHEELS:
            pytest.skip("needs the wheel of isaaclab: run `make clients`")
        script = Path(__file__).with_name("isaac_client.py")
        self.process = subprocess.Popen(
            [sys.executable, script, WHEELS[0], url], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.said = self._line()

    def __enter__(self) -> Isaac:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()

    def read(self) -> list[float]:
        """What `advance` gives: x y z, the quaternion x y z w, three buttons."""
        self._say("read")
        return [float(number) for number in self._line().split()]

    def push(self, x_n: float, y_n: float, z_n: float) -> None:
        """Have it push; its thread sends this force from now on [N]."""
        self._say(f"push {x_n} {y_n} {z_n}")

    def _say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()
