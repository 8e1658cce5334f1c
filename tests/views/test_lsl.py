"""`hapticd lsl`: what a laboratory's recorder gets is every tick of the daemon, at its deadline."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import pyxdf

from hapticd.client import EventCode
from hapticd.doctor import endpoints
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Gap, Position, Status, Timing
from hapticd.telemetry.wire import Topic
from hapticd_views.lsl.bridge import Bridge
from hapticd_views.lsl.channels import JoinedTick, Layout
from tests.daemon.running import HAPTICD, PATIENCE_S, Daemon, Subscriber
from tests.doctor.machine import says
from tests.views.xdf import write_xdf

CONFIG = Path(__file__).parent.parent.parent / "config"
# A session of its own: another worker's streams have the same names, and a reader would take either.
LOOPBACK = (
    f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = tests-{os.getpid()}\n"
    "[multicast]\nResolveScope = machine\n[log]\nlevel = -3\n"
)
TICKS = 1500

# In a process of its own: liblsl's threads and its configuration stay out of the other tests.
READER = """
import json, sys, time
import pylsl
before = time.monotonic()
clock = pylsl.local_clock()
assert before - 1e-3 < clock < time.monotonic() + 1e-3, "another clock"
inlets = []
for what in ("ticks", "events"):
    found = pylsl.resolve_byprop("name", "hapticd-default-" + what, timeout=60.0)
    inlet = pylsl.StreamInlet(found[0], max_buflen=60, recover=False)
    inlet.open_stream(timeout=60.0)
    inlets.append(inlet)
print("open", flush=True)
kept = {"ticks": ([], []), "events": ([], [])}
end = time.monotonic() + 60.0
def enough():
    texts = [json.loads(text) for text, in kept["events"][0]]
    marked = [text["seq"] for text in texts if text["kind"] == "marker"]
    ticks = kept["ticks"][0]
    return len(ticks) >= TICKS and bool(marked) and ticks[-1][0] >= marked[0]
while not enough() and time.monotonic() < end:
    for name, inlet in zip(("ticks", "events"), inlets):
        samples, times = inlet.pull_chunk(timeout=0.1)
        kept[name][0].extend(samples)
        kept[name][1].extend(times)
print(json.dumps({name: [inlet.info(5.0).as_xml(), *kept[name]] for name, inlet in zip(("ticks", "events"), inlets)}))
"""

# Keeps its inlet, as LabRecorder does, until ticks come ten apart; then looks for the stream as one that comes anew.
RELOADED = """
import json, time
import pylsl
def find():
    return pylsl.resolve_byprop("name", "hapticd-default-ticks", timeout=60.0)[0]
first = find()
inlet = pylsl.StreamInlet(first, max_buflen=60, recover=True)
inlet.open_stream(timeout=60.0)
print("open", flush=True)
seqs = []
end = time.monotonic() + 60.0
while not (len(seqs) > 20 and seqs[-1] - seqs[-21] == 200) and time.monotonic() < end:
    samples, _ = inlet.pull_chunk(timeout=0.1)
    seqs.extend(sample[0] for sample in samples)
print(json.dumps({"rates_hz": [first.nominal_srate(), find().nominal_srate()], "twenty_ticks": seqs[-1] - seqs[-21]}))
"""


@pytest.fixture(scope="module")
def streamed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """A daemon, the bridge, a reader of both streams, and a subscriber beside them."""
    folder = tmp_path_factory.mktemp("lsl")
    with Daemon((CONFIG / "hapticd.toml").read_text()).wait_ready() as daemon:
        environment = surroundings(daemon, folder)
        bridge_command = [HAPTICD, "lsl", "--json"]
        reader_command = [sys.executable, "-c", READER.replace("TICKS", str(TICKS))]
        with running(bridge_command, environment) as bridge, running(reader_command, environment) as reader:
            await_open(reader)
            with Subscriber(daemon.endpoint, "hapticd/timing") as subscriber:
                maps = subscriber.maps()
                deadlines_ns: dict[int, int] = {}
                while len(deadlines_ns) < TICKS // 2:
                    _, tick = next(maps)
                    deadlines_ns[tick["seq"]] = tick["deadline_ns"]
                subprocess.run([HAPTICD, "mark", "go <1>"], env=environment, check=True, capture_output=True)
                told, complained = reader.communicate(timeout=2 * PATIENCE_S)
                assert reader.returncode == 0, complained
            open_to_all = endpoints.streams()
            bridge.send_signal(signal.SIGINT)
            said, warned = bridge.communicate(timeout=PATIENCE_S)
        yield {
            **json.loads(told), "deadlines_ns": deadlines_ns, "said": json.loads(said), "warned": warned,
            "code": bridge.returncode, "doctor": open_to_all,
        }  # fmt: skip


def surroundings(daemon: Daemon, folder: Path) -> dict[str, str]:
    """The environment of the bridge and of its readers; what liblsl reads lies in the folder."""
    configuration = folder / "lsl_api.cfg"
    configuration.write_text(LOOPBACK)
    runtime = str(daemon.directory / "run")
    return {**os.environ, "HAPTICD_RUNTIME_DIR": runtime, "LSLAPICFG": str(configuration)}


@contextlib.contextmanager
def running(command: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A process that does not outlive us."""
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def await_open(reader: subprocess.Popen[str]) -> None:
    """Return when a reader has its inlets; one that ends instead says why."""
    assert reader.stdout is not None
    if reader.stdout.readline() != "open\n":
        pytest.fail(f"the reader has ended: {reader.communicate(timeout=PATIENCE_S)[1]}")


def test_every_tick_arrives_in_order(streamed: dict[str, Any]) -> None:
    _, samples, _ = streamed["ticks"]
    seq = np.array([sample[0] for sample in samples])
    assert len(seq) >= TICKS
    assert (np.diff(seq) == 1).all()
    assert streamed["said"]["missing"] == 0
    assert streamed["said"]["layouts"] == 1


def test_the_time_of_a_sample_is_the_deadline_of_its_tick(streamed: dict[str, Any]) -> None:
    _, samples, times_s = streamed["ticks"]
    shared = 0
    for sample, time_s in zip(samples, times_s, strict=True):
        deadline_ns = streamed["deadlines_ns"].get(int(sample[0]))
        if deadline_ns is not None:
            shared += 1
            assert time_s == deadline_ns * 1e-9
    assert shared > TICKS // 4


def test_channels_have_names_and_units(streamed: dict[str, Any]) -> None:
    info = ElementTree.fromstring(streamed["ticks"][0])
    channels = [(one.findtext("label"), one.findtext("unit")) for one in info.iter("channel")]
    assert channels[:3] == [("seq", "ticks"), ("position_m_x", "m"), ("velocity_m_per_s_x", "m/s")]
    assert channels[-3:] == [("damping_n_s_per_m_0", "N s/m"), ("in_contact_0", ""), ("late_us", "us")]
    assert len(streamed["ticks"][1][0]) == len(channels) == int(info.findtext("channel_count") or 0)
    assert float(info.findtext("nominal_srate") or 0) == 1000.0
    assert info.findtext("desc/hapticd/device")
    assert info.findtext("desc/hapticd/law") == "ring-damping"


def test_markers_cycles_and_events_are_texts_in_between(streamed: dict[str, Any]) -> None:
    _, samples, times_s = streamed["events"]
    texts = [json.loads(text) for (text,) in samples]
    at = next(index for index, text in enumerate(texts) if text["kind"] == "marker")
    assert texts[at]["text"] == "go <1>"
    by_seq = {int(sample[0]): time_s for sample, time_s in zip(*streamed["ticks"][1:], strict=True)}
    assert times_s[at] == pytest.approx(by_seq[texts[at]["seq"]], abs=0.02)
    for text, time_s in zip(texts, times_s, strict=True):
        if text["kind"] == "cycle" and text["seq"] in by_seq:
            assert time_s == pytest.approx(by_seq[text["seq"]], abs=1e-6)


def test_an_xdf_file_of_the_streams_has_every_tick(streamed: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "session.xdf"
    write_xdf(path, [streamed["ticks"], streamed["events"]])
    streams, _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False, synchronize_clocks=False)
    ticks, events = sorted(streams, key=lambda stream: stream["info"]["type"][0])
    assert ticks["info"]["name"] == ["hapticd-default-ticks"]
    assert (np.diff(ticks["time_series"][:, 0]) == 1.0).all()
    assert ticks["time_series"].tolist() == streamed["ticks"][1]
    assert ticks["time_stamps"].tolist() == streamed["ticks"][2]
    assert any("go <1>" in text for (text,) in events["time_series"])


def test_after_a_reload_of_every_ticks_the_stream_has_the_new_rate_and_its_reader_goes_on(tmp_path: Path) -> None:
    """A stream cannot change its rate while it lives."""
    config = (CONFIG / "hapticd.toml").read_text()
    with Daemon(config).wait_ready() as daemon:
        environment = surroundings(daemon, tmp_path)
        with running([HAPTICD, "lsl"], environment), running([sys.executable, "-c", RELOADED], environment) as reader:
            await_open(reader)
            daemon.config.write_text(config.replace("[telemetry]\n", "[telemetry]\nevery_ticks = 10\n"))
            assert daemon.ask("reload") == ""
            told, complained = reader.communicate(timeout=3 * PATIENCE_S)
            assert reader.returncode == 0, complained
    assert json.loads(told) == {"rates_hz": [1000.0, 100.0], "twenty_ticks": 200.0}


def test_it_is_said_that_everybody_can_listen(streamed: dict[str, Any]) -> None:
    assert "LSL listens on all addresses of this computer and encrypts nothing" in streamed["warned"]
    assert streamed["code"] == 0
    says(streamed["doctor"], "advice", "Lab Streaming Layer listens on every address")


def test_the_doctor_looks_at_every_address_and_at_ports_of_lsl_only(tmp_path: Path) -> None:
    (tmp_path / "proc/net").mkdir(parents=True)
    head = "  sl  local_address rem_address   st tx_queue rx_queue\n"
    mine = "   0: 0100007F:40BC 00000000:0000 0A 00000000:00000000\n"  # 127.0.0.1:16572
    other = "   1: 00000000:0016 00000000:0000 0A 00000000:00000000\n"  # every address, port 22
    talking = "   2: 00000000:40BD 0100007F:1234 01 00000000:00000000\n"  # no listener
    (tmp_path / "proc/net/tcp").write_text(head + mine + other + talking)
    says(endpoints.streams(tmp_path), "ok", "no Lab Streaming Layer stream is open")
    everywhere = "   0: 00000000000000000000000000000000:40BE 0:0000 0A 00000000:00000000\n"  # [::]:16574
    (tmp_path / "proc/net/tcp6").write_text(head + everywhere)
    says(endpoints.streams(tmp_path), "advice", "port 16574:")


# -- the bridge alone


def tick(seq: int, walls: int = 1) -> list[Any]:
    ones = (1.0,) * walls
    at_s = 1e9 + seq * 1e-3
    return [
        Position(at_s, seq, (0.1, 0.2), (0.0, 0.0), (1.0, 2.0), (1.0, 2.0)),
        Energy(at_s, seq, 0.1, 0.2, 0.3, 0.4),
        Damping(at_s, seq, ones, (True,) * walls, ones),
        Timing(at_s, seq, seq * 1_000_000, 10.0, 5.0, 1e-3),
    ]


class Kept:
    """In the place of liblsl: what it would have got."""

    made: list[Kept]

    def __init__(self, layout: Layout, status: Status) -> None:
        self.layout, self.ticks, self.texts = layout, list[JoinedTick](), list[tuple[dict[str, Any], float]]()
        self.made.append(self)

    def push(self, ticks: list[JoinedTick]) -> None:
        for one in ticks:
            assert len(one.sample) == len(self.layout.channels)
        self.ticks += ticks

    def tell(self, told: dict[str, Any], time_s: float) -> None:
        self.texts.append((told, time_s))


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> list[Kept]:
    Kept.made = []
    monkeypatch.setattr("hapticd_views.lsl.bridge.Outlets", Kept)
    return Kept.made


STATUS = Status(axes=("x", "y"), rate_hz=1000.0)


def test_messages_of_a_tick_are_joined_in_whatever_batches_they_come(kept: list[Kept]) -> None:
    bridge = Bridge()
    whole = [tick(seq) for seq in range(40)]
    for batch in (whole[:20], whole[20:]):
        for topic in range(4):
            bridge.take([one[topic] for one in batch], STATUS)
    (outlets,) = kept
    assert [one.position.seq for one in outlets.ticks] == list(range(40))
    assert outlets.ticks[7].sample[:3] == [7.0, 0.1, 0.2]
    assert outlets.ticks[7].time_s == 0.007


def test_a_wall_that_is_added_makes_new_streams(kept: list[Kept]) -> None:
    bridge = Bridge()
    bridge.take([*tick(0), *tick(1), *tick(2, walls=2)], STATUS)
    assert [len(outlets.ticks) for outlets in kept] == [2, 1]
    assert kept[1].layout.walls == 2
    assert bridge.streamed.layouts == 2


def test_another_rate_makes_new_streams(kept: list[Kept]) -> None:
    bridge = Bridge()
    bridge.take([*tick(0), *tick(1)], STATUS)
    thinned = dataclasses.replace(STATUS, every_ticks=10)
    bridge.take([thinned], thinned)
    bridge.take([*tick(10), *tick(20)], thinned)
    assert [outlets.layout.rate_hz for outlets in kept] == [1000.0, 100.0]
    assert [len(outlets.ticks) for outlets in kept] == [2, 2]


def test_what_is_missing_is_told(kept: list[Kept]) -> None:
    bridge = Bridge()
    bridge.take([*tick(0), Gap(Topic.POSITION, 0, 5, 4), *tick(5)], STATUS)
    assert bridge.streamed.missing == 4
    assert [told["kind"] for told, _ in kept[0].texts] == ["gap"]
    for seq in range(6, 6 + 4002):
        bridge.take(tick(seq)[:3], STATUS)
    assert bridge.streamed.missing == 4 + 2, "a tick whose timing never came"


def test_an_event_before_the_first_tick_is_kept_until_there_is_a_stream(kept: list[Kept]) -> None:
    bridge = Bridge()
    now_s = time.time()
    bridge.take([Event(now_s, 0, EventCode.MARKED, "go", {})], STATUS)
    assert kept == []
    bridge.take([*tick(0), Cycle(1e9 + 0.5, 500, 0, 3, 0.0, 1e-5, 20.0, 0.1)], STATUS)
    (marker, marked_s), (cycle, ended_s) = kept[0].texts
    assert (marker["kind"], marker["text"]) == ("marker", "go")
    assert marked_s == pytest.approx(time.monotonic(), abs=30.0)
    assert (cycle["wall"], cycle["generated_j"]) == (0, 1e-5)
    assert ended_s == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(("ticks_s", "told_s"), [(-3600.0, 0.0), (3600.0, 3600.0), (None, 3600.0), (0.0, 0.0)])
def test_a_text_is_of_now_whatever_the_clock_did(kept: list[Kept], ticks_s: float | None, told_s: float) -> None:
    """Set ahead and told before a tick shows it; set back, which no daemon follows, and told after or before a tick."""
    bridge = Bridge()
    now_s, today_s = time.monotonic(), time.time()
    if ticks_s is not None:
        bridge.take([*tick(1)[:3], Timing(today_s + ticks_s, 1, round(now_s * 1e9), 10.0, 5.0, 1e-3)], STATUS)
    bridge.take([Event(today_s + told_s, 2, EventCode.MARKED, "go", {}), *tick(3)], STATUS)
    ((_, at_s),) = kept[0].texts
    assert at_s == pytest.approx(now_s, abs=1.0)


def test_a_daemon_that_does_not_run_is_said(tmp_path: Path) -> None:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run([HAPTICD, "lsl"], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "no daemon answers; start it with `hapticd run`" in done.stderr
    assert "listens" not in done.stderr
