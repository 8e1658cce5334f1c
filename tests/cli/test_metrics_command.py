"""`hapticd metrics` says what Prometheus reads: true, well named, complete; reading it costs a daemon little."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import threading
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import promql_parser
import pytest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.openmetrics.parser import text_string_to_metric_families as openmetrics_families
from prometheus_client.parser import text_string_to_metric_families

from hapticd.cli.metrics import server
from hapticd.cli.metrics.families import families
from hapticd.client.commands import RefusedError, command
from hapticd.paths import directory
from hapticd.telemetry.records import LATE_EDGES_US, Status
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon

ROOT = Path(__file__).parent.parent.parent
DASHBOARD = directory("config") / "grafana/hapticd.json"
DAEMON = {"daemon": "default"}


def metrics(runtime: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, "metrics", *arguments],
        env={**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime), **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )


def parsed(text: str) -> dict[str, Metric]:
    return {family.name: family for family in text_string_to_metric_families(text)}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, Any]]:
    """What is printed of a daemon that has refused two requests, and its own status after that."""
    with Daemon("").wait_ready() as daemon, pytest.MonkeyPatch.context() as patch:
        runtime = daemon.directory / "run"
        patch.setenv("HAPTICD_RUNTIME_DIR", str(runtime))
        for _ in range(2):
            with pytest.raises(RefusedError):
                command("dance")
        while command("status")["status"]["requests_refused"] < 2:
            pass
        done = metrics(runtime)
        assert done.returncode == 0, done.stderr
        return done.stdout, command("status")["status"]


def test_what_it_prints_is_what_the_daemon_says(said: tuple[str, dict[str, Any]]) -> None:
    text, status = said
    found = {
        (sample.name, sample.labels["daemon"]): sample for family in parsed(text).values() for sample in family.samples
    }
    value = {name: sample.value for (name, daemon), sample in found.items() if daemon == "default"}
    assert value["hapticd_up"] == 1
    assert value["hapticd_start_time_seconds"] == status["started_timestamp"]
    assert value["hapticd_armed"] == status["armed"] == 1
    assert value["hapticd_rate_set_hertz"] == status["rate_hz"]
    assert value["hapticd_requests_refused_total"] == status["requests_refused"] == 2
    assert value["hapticd_force_limit_newtons"] == status["max_force_n"]
    assert 0 < value["hapticd_ticks_total"] <= status["ticks"]
    assert 0 < value["hapticd_lateness_max_seconds"] <= status["late_max_us"] * 1e-6
    assert found["hapticd_law_info", "default"].labels["law"] == status["law"]
    assert found["hapticd_device_info", "default"].labels["simulated"] == "true"


def test_the_histogram_has_every_tick_in_seconds(said: tuple[str, dict[str, Any]]) -> None:
    samples = parsed(said[0])["hapticd_lateness_seconds"].samples
    buckets = {sample.labels["le"]: sample.value for sample in samples if sample.name.endswith("_bucket")}
    assert [float(edge) for edge in buckets] == pytest.approx([*(edge * 1e-6 for edge in LATE_EDGES_US), float("inf")])
    assert list(buckets.values()) == sorted(buckets.values())
    values = {sample.name: sample.value for sample in samples}
    assert buckets["+Inf"] == values["hapticd_lateness_seconds_count"]
    assert 0 < values["hapticd_lateness_seconds_sum"] < values["hapticd_lateness_seconds_count"]


def test_names_are_those_that_prometheus_asks_for(said: tuple[str, dict[str, Any]]) -> None:
    """Base units at the end of the name, `_total` on counts and only there, a line of help."""
    for family in parsed(said[0]).values():
        assert re.fullmatch(r"hapticd(_[a-z]+)+", family.name)
        assert not re.search(r"_(us|ms|ns|hz|percent|n|s)$", family.name)
        assert family.documentation.endswith(".")
        for sample in family.samples:
            assert sample.name.endswith("_total") == (family.type == "counter")
            assert "instance" not in sample.labels, "Prometheus sets that itself"


def test_a_late_share_is_that_of_the_edge_that_is_called_late() -> None:
    status = Status(ticks=10, late_histogram=(0, 0, 0, 0, 7, 2, 1, 0, 0, 0, 0, 0), late_sum_us=2000.0)
    value = {sample.name: sample.value for family in families([("d", status)]) for sample in family.samples}
    assert (value["hapticd_late_ticks_total"], value["hapticd_late_ratio"]) == (3, 0.3)
    assert value["hapticd_lateness_seconds_sum"] == 0.002


def test_the_page_names_each_of_them_and_no_other(said: tuple[str, dict[str, Any]]) -> None:
    page = (ROOT / "docs/metrics.md").read_text()
    named = dict(re.findall(r"^\| `(hapticd_\w+)` \| (\w+)", page, re.MULTILINE))
    ends = {"counter": "_total"}
    assert named == {f"{family.name}{ends.get(family.type, '')}": family.type for family in parsed(said[0]).values()}


def names_of(expression: Any) -> Iterator[tuple[str, set[str]]]:
    """Metrics in an expression, each with the labels that it is chosen by."""
    text = promql_parser.parse(expression).prettify()
    for name, chosen in re.findall(r"(hapticd_\w+)(?:\{([^}]*)\})?", text):
        yield name, set(re.findall(r"(\w+)(?:=~|!=|=|!~)", chosen))


def test_every_query_of_the_dashboard_finds_something(said: tuple[str, dict[str, Any]]) -> None:
    dashboard = json.loads(DASHBOARD.read_text())
    queries = [target for panel in dashboard["panels"] for target in panel["targets"]]
    queries += dashboard["annotations"]["list"]
    there: dict[str, set[str]] = {}
    for family in parsed(said[0]).values():
        for sample in family.samples:
            there.setdefault(sample.name, set()).update(sample.labels)
    there.setdefault("hapticd_device_metric", {"daemon", "metric"})  # of a driver that keeps numbers
    assert len(queries) > 15
    for query in queries:
        found = list(names_of(query["expr"].replace("$__rate_interval", "1m").replace("$daemon", ".*")))
        assert found, query["expr"]
        for name, labels in found:
            assert name in there, query["expr"]
            assert labels <= there[name], query["expr"]
            shown = set(re.findall(r"{{(\w+)}}", query.get("legendFormat", query.get("titleFormat", ""))))
            assert shown <= there[name], query
    variables = {variable["name"]: variable for variable in dashboard["templating"]["list"]}
    assert variables["daemon"]["query"]["query"] == "label_values(hapticd_up, daemon)"
    used = set(re.findall(r"\$\{?(?!__)(\w+)", DASHBOARD.read_text()))
    assert used == set(variables)


def test_the_panels_of_the_dashboard_lie_beside_each_other() -> None:
    panels = json.loads(DASHBOARD.read_text())["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    cells = [
        (x, y)
        for panel in panels
        for x in range(panel["gridPos"]["x"], panel["gridPos"]["x"] + panel["gridPos"]["w"])
        for y in range(panel["gridPos"]["y"], panel["gridPos"]["y"] + panel["gridPos"]["h"])
    ]
    assert len(set(cells)) == len(cells)
    assert max(x for x, _ in cells) < 24


def test_a_daemon_that_does_not_answer_is_down_and_hides_no_other() -> None:
    with Daemon("").wait_ready() as daemon:
        os.kill(daemon.process.pid, signal.SIGSTOP)
        done = metrics(daemon.directory / "run")
        found = parsed(done.stdout)
        assert [(sample.labels, sample.value) for sample in found["hapticd_up"].samples] == [(DAEMON, 0.0)]
        assert found["hapticd_ticks"].samples == []
        assert done.returncode == 1
        assert done.stderr.startswith("hapticd: no daemon answers: start one with")


@contextmanager
def serving(runtime: Path) -> Iterator[str]:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime)}
    command = [HAPTICD, "metrics", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        line = process.stderr.readline()
        try:
            yield line.removeprefix("serving ").strip()
        finally:
            process.terminate()
            assert process.wait(PATIENCE_S) == 0


def test_it_serves_what_a_scraper_asks_for_and_ends_when_it_is_told(tmp_path: Path) -> None:
    with Daemon("").wait_ready() as daemon, serving(daemon.directory / "run") as url:
        with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
            assert answer.headers["Content-Type"].startswith("text/plain")
            assert parsed(answer.read().decode())["hapticd_up"].samples[0].value == 1
        asked = urllib.request.Request(url, headers={"Accept": "application/openmetrics-text; version=1.0.0"})
        with urllib.request.urlopen(asked, timeout=PATIENCE_S) as answer:
            assert answer.headers["Content-Type"].startswith("application/openmetrics-text")
            families_of: Callable[[str], Iterator[Metric]] = openmetrics_families
            assert {family.name for family in families_of(answer.read().decode())} >= {"hapticd_daemon"}


class Counting:
    """A server in this process, and how often it asked the daemons."""

    def __init__(self) -> None:
        self.asked = 0
        self.server = server.MetricsServer("127.0.0.1", 0, server.Asked(self._ask))
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.05,))
        self.thread.start()

    def _ask(self) -> list[Metric]:
        self.asked += 1
        return [GaugeMetricFamily("hapticd_up", "Up.", value=1.0)]

    def connect(self, sent: bytes = b"") -> socket.socket:
        connection = socket.create_connection(("127.0.0.1", self.server.server_port), timeout=PATIENCE_S)
        connection.sendall(sent)
        return connection

    def get(self) -> str:
        with urllib.request.urlopen(self.server.url, timeout=PATIENCE_S) as answer:
            return str(answer.read().decode())

    def close(self) -> None:
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


@pytest.fixture
def counting() -> Iterator[Counting]:
    served = Counting()
    yield served
    served.close()


def test_a_crowd_of_scrapers_asks_the_daemons_once(counting: Counting, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "FRESH_S", 3600.0)
    before = counting.asked
    for _ in range(20):
        assert "hapticd_up 1.0" in counting.get()
    assert counting.asked <= before + 1


def test_a_peer_that_says_nothing_is_cut_off_and_one_too_many_is_closed(
    counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "LONGEST_S", 1.0)
    silent = [counting.connect(b"GET /met") for _ in range(server.MOST_CONNECTIONS)]
    with counting.connect() as one_too_many:
        assert one_too_many.recv(1) == b""
    for connection in silent:
        assert connection.recv(1) == b""
        connection.close()
    assert "hapticd_up 1.0" in counting.get()


@pytest.mark.parametrize("sent", [b"\0" * 70_000, b"GET / HTTP/9.9\r\n\r\n", b"GET /" + b"a" * 70_000, b"\r\n" * 100])
def test_nonsense_ends_its_own_connection_only(counting: Counting, sent: bytes) -> None:
    with counting.connect() as connection:
        try:
            connection.sendall(sent)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(4096):
                pass
        except OSError:
            pass  # closed while we were sending
    assert "hapticd_up 1.0" in counting.get()


@pytest.mark.parametrize("listen", ["9876", "127.0.0.1", "127.0.0.1:x", "127.0.0.1:70000", ":9876"])
def test_an_address_that_is_none_is_refused(tmp_path: Path, listen: str) -> None:
    done = metrics(tmp_path, "--listen", listen)
    assert done.returncode == 2
    assert done.stderr.startswith(f"hapticd: --listen {listen}: must be HOST:PORT, such as")


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        listen = f"127.0.0.1:{taken.getsockname()[1]}"
        done = metrics(tmp_path, "--listen", listen)
    assert (done.returncode, done.stderr) == (
        1,
        f"hapticd: --listen {listen}: Address already in use; name another address or port\n",
    )


def test_without_the_extra_it_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "prometheus_client.py").write_text("raise ModuleNotFoundError(name='prometheus_client')\n")
    done = metrics(tmp_path, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stderr) == (
        1,
        "hapticd: this needs prometheus_client: pip install 'hapticd[metrics]'\n",
    )
