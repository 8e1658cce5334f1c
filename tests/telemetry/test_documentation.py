"""docs/telemetry.md is the contract: its tables are what is sent, its examples compile, run and print what is true."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hapticd import client
from hapticd.telemetry import wire
from hapticd.telemetry.records import LATE_EDGES_US, Status
from hapticd.telemetry.wire import Topic
from hapticd.tick.event import LoopEvent
from tests.telemetry.sockets import Wire, served, ticks, wait_until

DOCS = Path(__file__).parent.parent.parent / "docs"
PAGE = (DOCS / "telemetry.md").read_text()
COMMON = {"timestamp", "seq", "invalid", "fields"}


def documented(topic: str) -> dict[str, str]:
    """Type of each key in the table of a topic."""
    section = re.split(r"^#+ ", PAGE.split(f"### `{topic}`\n")[1], maxsplit=1, flags=re.MULTILINE)[0]
    return dict(re.findall(r"^\| `(\w+)` \| ([^|]+?) \|", section, flags=re.MULTILINE))


@pytest.mark.parametrize("topic", list(Topic))
def test_the_tables_name_every_key_and_no_other(topic: Topic) -> None:
    record = next(one for one in vars(client).values() if getattr(one, "topic", None) is topic)
    fields = {field.name: str(field.type) for field in dataclasses.fields(record) if field.name not in COMMON}
    table = documented(topic)
    assert set(table) == set(fields)
    kinds = {"float": "float", "int": "int", "bool": "bool", "string": "str"}
    for key, kind in table.items():
        word = re.sub(r"^(array|map) of (\d+ )?|,.*", "", kind)
        assert fields[key].startswith("tuple") == kind.startswith("array"), key
        assert fields[key].startswith("dict") == kind.startswith("map"), key
        assert kinds[word] in fields[key], key


def test_the_edges_of_the_histogram_are_those_of_the_page() -> None:
    edges = re.findall(r"below (\d+) us, then up to ([\d, ]+) us", PAGE)
    assert [int(edge) for edge in ", ".join(edges[0]).split(", ")] == list(LATE_EDGES_US)
    assert f"array of {len(LATE_EDGES_US) + 1} int" in PAGE
    assert f"version of this contract: {wire.SCHEMA};" in PAGE


@pytest.mark.parametrize(("language", "name"), [("python", "subscribe.py"), ("cpp", "subscribe.cpp")])
def test_the_page_shows_the_examples_as_they_are(language: str, name: str) -> None:
    assert f"`docs/examples/{name}`:\n\n```{language}\n{(DOCS / 'examples' / name).read_text()}```\n" in PAGE


def test_the_typed_examples_compile() -> None:
    snippets = re.findall(r"```python\n(import hapticd\n.+?)```", PAGE, flags=re.DOTALL)
    assert len(snippets) == 2
    for snippet in snippets:
        compile(snippet, "telemetry.md", "exec")
        assert "hapticd.connect(" in snippet
    for names in re.findall(r"from hapticd\.client import (.+)", "".join(snippets)):
        for name in names.split(", "):
            assert hasattr(client, name)


def printed_by(command: Sequence[str | Path]) -> list[str]:
    """What a subscriber prints of a known stretch of ticks."""
    with Wire() as wire:
        subscriber = subprocess.Popen([*command, wire.endpoint], stdout=subprocess.PIPE, text=True)
        assert subscriber.stdout is not None
        wait_until(lambda: served(wire.publisher) >= 3, "three subscriptions")
        wire.publisher.publish([record for record in ticks(1020) if not 700 <= record.seq < 720])
        wire.publisher.event(LoopEvent(103, "none -> tdpa", 1019, 0))
        lines: list[str] = []
        while not lines or not lines[-1].startswith("event"):
            line = subscriber.stdout.readline()
            assert line, f"it ended after {lines}"
            lines.append(line.rstrip("\n"))
        subscriber.kill()
        subscriber.wait()
        subscriber.stdout.close()
    return lines


def assert_true(lines: list[str]) -> None:
    """Lines of both examples, whose floats may be written differently."""
    records = ticks(1020)
    positions = [re.findall(r"-?\d[\d.e+-]*", line) for line in lines if line.startswith("tick")]
    wanted = [[seq, *records[seq].position_m, *records[seq].force_n] for seq in (0, 500, 1000)]
    assert [[float(one) for one in numbers] for numbers in positions] == wanted
    assert [line for line in lines if line.startswith("lost")] == ["lost 20 ticks"]
    cycles = [line.split() for line in lines if line.startswith("cycle")]
    assert [(int(number), float(made)) for _, number, _, made in cycles] == [
        (cycle, 2e-5 if cycle % 5 == 0 else 0.0) for cycle in range(1, 10)
    ]
    assert lines[-1] == "event 103 none -> tdpa"


def test_the_python_example_prints_what_happened() -> None:
    assert_true(printed_by([sys.executable, DOCS / "examples" / "subscribe.py"]))


def test_the_cpp_example_prints_what_happened(tmp_path: Path) -> None:
    compiler = shutil.which("g++")
    if (
        compiler is None
        or not Path("/usr/include/nlohmann/json.hpp").exists()
        or not Path("/usr/include/zmq.h").exists()
    ):
        pytest.skip("apt install g++ libzmq3-dev nlohmann-json3-dev")
    source = DOCS / "examples" / "subscribe.cpp"
    built = subprocess.run(
        [compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", tmp_path / "subscribe", source, "-lzmq"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    assert_true(printed_by([tmp_path / "subscribe"]))


def test_the_plotjuggler_layout_names_series_that_exist() -> None:
    """PlotJuggler calls a number topic/key, and an element of an array topic/key[i]."""
    record = ticks(1)[0]
    maps = {
        Topic.POSITION: wire.position_map(record, 0.0),
        Topic.ENERGY: wire.energy_map(record, 0.0),
        Topic.DAMPING: wire.damping_map(record, 0.0),
        Topic.TIMING: wire.timing_map(record, 0.0),
        Topic.CYCLE: wire.cycle_map(record, 0.0, 0),
    }
    series = set()
    for topic, fields in maps.items():
        for key, value in fields.items():
            many = isinstance(value, list | tuple)
            series |= {f"{topic}/{key}[{index}]" for index in range(len(value))} if many else {f"{topic}/{key}"}
    curves = {curve.get("name") for curve in ElementTree.parse(DOCS / "examples" / "plotjuggler.xml").iter("curve")}
    assert curves
    assert curves <= series


def test_a_status_is_documented_in_full() -> None:
    assert set(documented("hapticd/status")) == set(Status().as_map()) - COMMON
