"""docs/telemetry.md is the contract: its tables are what is sent, its examples compile, run and print what is true."""

from __future__ import annotations

import dataclasses
import json
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
from hapticd_views.recording import messages
from tests.daemon.running import Daemon
from tests.remote.stage import drives_the_tool
from tests.telemetry.sockets import Wire, served, ticks, wait_until

ROOT = Path(__file__).parent.parent.parent
DOCS = ROOT / "docs"
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


@pytest.mark.parametrize(
    ("language", "name"), [("python", "subscribe.py"), ("cpp", "subscribe.cpp"), ("js", "javascript/subscribe.mjs")]
)
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


def series(axes: int) -> set[str]:
    """What PlotJuggler makes of a tick: a number is topic/key, an element of an array topic/key[i]."""
    record = ticks(1)[0]
    for name in ("position_m", "velocity_m_per_s", "force_n", "force_requested_n"):
        setattr(record, name, getattr(record, name) * axes)
    maps = {
        Topic.POSITION: wire.position_map(record, 0.0),
        Topic.ENERGY: wire.energy_map(record, 0.0),
        Topic.DAMPING: wire.damping_map(record, 0.0),
        Topic.TIMING: wire.timing_map(record, 0.0),
        Topic.CYCLE: wire.cycle_map(record, 0.0, 0),
    }
    found = set()
    for topic, fields in maps.items():
        for key, value in fields.items():
            many = isinstance(value, list | tuple)
            found |= {f"{topic}/{key}[{index}]" for index in range(len(value))} if many else {f"{topic}/{key}"}
    return found


@pytest.mark.parametrize(("name", "axes"), [("plotjuggler.xml", 1), ("plotjuggler-3-axes.xml", 3)])
def test_a_plotjuggler_layout_names_series_that_exist(name: str, axes: int) -> None:
    drawn = list(ElementTree.parse(DOCS / "examples" / name).iter("curve"))
    curves = {str(curve.get("name")) for curve in drawn}
    assert len(curves) == len(drawn) > 8
    assert curves <= series(axes)
    assert {curve for curve in curves if curve.startswith("hapticd/position/position_m")} == {
        f"hapticd/position/position_m[{axis}]" for axis in range(axes)
    }


@pytest.mark.parametrize("name", ["plotjuggler.xml", "plotjuggler-3-axes.xml"])
def test_a_recording_has_the_series_of_the_layouts_too(name: str) -> None:
    """Its channels have the topics' names, and JSON schemas by which PlotJuggler takes messages apart."""
    schemas = {messages.topic_of(kind): messages.schema_of(kind)["properties"] for kind in messages.TELEMETRY}
    for curve in ElementTree.parse(DOCS / "examples" / name).iter("curve"):
        topic, _, key = str(curve.get("name")).rpartition("/")
        key, element, _ = key.partition("[")
        assert schemas[topic][key]["type"] == ("array" if element else "integer" if key == "cycle" else "number")


@pytest.fixture(scope="module")
def javascript(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with what its lock file names, as `npm ci` gets it."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("apt install npm")
    folder = tmp_path_factory.mktemp("javascript")
    for name in ("package.json", "package-lock.json", "subscribe.mjs", "drive.mjs"):
        shutil.copy(DOCS / "examples" / "javascript" / name, folder)
    command = [npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "subscribe.mjs"


def test_the_javascript_example_prints_what_happened(javascript: Path) -> None:
    assert_true(printed_by(["node", javascript]))


def test_the_javascript_example_reads_a_running_daemon(javascript: Path) -> None:
    with Daemon((ROOT / "config" / "hapticd.toml").read_text()).wait_ready() as daemon:
        command = ["node", str(javascript), daemon.endpoint]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as subscriber:
            try:
                assert subscriber.stdout is not None
                lines: list[list[str]] = []
                while sum(line[0] == "tick" for line in lines) < 3:
                    lines.append(subscriber.stdout.readline().split())
                    assert lines[-1], f"it ended after {lines}"
            finally:
                subscriber.kill()
    seen = [int(line[1]) for line in lines if line[0] == "tick"]
    assert seen == [seen[0], seen[0] + 500, seen[0] + 1000]
    assert not [line for line in lines if line[0] == "lost"]


def test_the_javascript_client_drives_a_running_daemon(javascript: Path) -> None:
    drives_the_tool(["node", javascript.with_name("drive.mjs")])


def test_the_lock_file_names_no_place() -> None:
    """Packages come from whatever registry npm is set to, and are known by their hashes."""
    lock = json.loads((DOCS / "examples" / "javascript" / "package-lock.json").read_text())
    packages = [package for name, package in lock["packages"].items() if name]
    assert len(packages) >= 2
    for package in packages:
        assert "resolved" not in package
        assert package["integrity"].startswith("sha512-")


def test_a_status_is_documented_in_full() -> None:
    assert set(documented("hapticd/status")) == set(Status().as_map()) - COMMON
