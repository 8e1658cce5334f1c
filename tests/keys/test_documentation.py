"""What docs/telemetry.md says to programs without hapticd lets the shipped examples in from another computer."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from hapticd.keys.file import Key, new_pair, write
from hapticd.tick.event import LoopEvent
from tests.keys.endpoints import Endpoints, ring_of
from tests.telemetry.sockets import served, ticks

DOCS = Path(__file__).parent.parent.parent / "docs"
SECTION = (DOCS / "telemetry.md").read_text().split("## From another computer")[1].split("\n## ")[0]
SERVER = new_pair()
LAPTOP = new_pair(SERVER.public)


def example(name: str, language: str, options: str, connects: str) -> str:
    """A shipped example with the lines of the page put before it connects."""
    snippets = re.findall(rf"```{language}\n(.+?)```", SECTION, flags=re.DOTALL)
    (snippet,) = (snippet for snippet in snippets if options in snippet)
    program = (DOCS / "examples" / name).read_text()
    assert program.count(connects) == 1
    program = program.replace(connects, f"{snippet}{connects}")
    for word, key in (("SERVER-KEY", SERVER.public), ("PUBLIC-KEY", LAPTOP.public), ("SECRET-KEY", LAPTOP.secret)):
        program = program.replace(f'"{word}"', f'"{key}"')
    return program


def assert_prints_ticks(command: Sequence[str | Path], place: Path, listed: Key) -> None:
    with Endpoints(ring_of(SERVER, laptop=listed)) as endpoints:
        subscriber = subprocess.Popen([*command, endpoints.telemetry], cwd=place, stdout=subprocess.PIPE, text=True)
        assert subscriber.stdout is not None
        try:
            endpoints.turn_until(lambda: served(endpoints.publisher) >= 3, "three subscriptions")
            endpoints.publisher.publish(ticks(1020))
            endpoints.publisher.event(LoopEvent(103, "none -> tdpa", 1019, 0))
            lines: list[str] = []
            while not lines or not lines[-1].startswith("event"):
                lines.append(subscriber.stdout.readline())
                assert lines[-1], f"it ended after {lines}"
        finally:
            subscriber.kill()
            subscriber.wait()
            subscriber.stdout.close()
    assert [line.split()[1] for line in lines if line.startswith("tick")] == ["0", "500", "1000"]


def test_the_python_example_comes_in_with_a_clients_file(tmp_path: Path) -> None:
    write(tmp_path / "laptop.key_secret", LAPTOP)
    program = tmp_path / "subscribe.py"
    program.write_text(example("subscribe.py", "python", "curve_serverkey", "socket.connect(endpoint)"))
    assert_prints_ticks([sys.executable, program], tmp_path, LAPTOP)


def test_the_cpp_example_comes_in_with_the_keys_of_a_clients_file(tmp_path: Path) -> None:
    compiler = shutil.which("g++")
    needed = (Path("/usr/include/nlohmann/json.hpp"), Path("/usr/include/zmq.h"))
    if compiler is None or not all(path.exists() for path in needed):
        pytest.skip("apt install g++ libzmq3-dev nlohmann-json3-dev")
    source = tmp_path / "subscribe.cpp"
    source.write_text(example("subscribe.cpp", "cpp", "ZMQ_CURVE_SERVERKEY", "    if (zmq_connect("))
    subprocess.run([compiler, "-std=c++17", "-o", tmp_path / "subscribe", source, "-lzmq"], check=True)
    assert_prints_ticks([tmp_path / "subscribe"], tmp_path, LAPTOP)
