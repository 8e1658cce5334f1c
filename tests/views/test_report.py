"""`hapticd report`: a verdict that the studies would give, and a page that nothing in a recording can take over."""

from __future__ import annotations

import base64
import json
import re
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticd
from hapticd.errors import HapticdError
from hapticd.figures.curves import Curves
from hapticd.offline.outcome import Outcome
from hapticd.offline.run import Run
from hapticd.telemetry.records import Event, Status
from hapticd_views.recording.messages import Note, RecordedGap
from hapticd_views.report.page import MOST_LINES, page
from hapticd_views.report.stability import judge
from hapticd_views.report.statement import Statement, statements
from hapticd_views.report.timeline import timeline
from hapticd_views.source import Source, open_source
from tests.daemon.running import HAPTICD
from tests.examples import examples
from tests.shipped import CONFIG, SIMULATED
from tests.views.recorded import EPOCH_S, write_recording

SHIPPED = [file for file in SIMULATED if "\n[[scene.walls]]" in file.read_text()]
DAILY = {"fig6-set1", "hapticd", "native-8-none", "wall-12-none", "wall-12-tdpa-unbounded", "wall-20-energy-cycle"}
WALL = CONFIG / "wall-12-energy-cycle.toml"
HOSTILE = '</td><script>alert("1")</script><img src=x onerror=alert(2)>&lt;b&gt;\x00\x1b[31m\u202e\ud800 end'


def recorded(tmp_path: Path, run: Run, config: Path = WALL, **more: Any) -> Source:
    return open_source(write_recording(tmp_path / f"{config.stem}.mcap", run, config.read_text(), **more))


def answer(told: list[Statement], question: str) -> Statement:
    return next(one for one in told if one.question.startswith(question))


@pytest.fixture(scope="module")
def still() -> Run:
    return hapticd.simulate(WALL, 3.0)


# -- was it stable?


@pytest.mark.parametrize(
    "config",
    [pytest.param(one, id=one.stem, marks=[] if one.stem in DAILY else pytest.mark.nightly) for one in SHIPPED],
)
def test_the_verdict_is_that_of_the_studies_which_know_hand_and_true_position(config: Path, tmp_path: Path) -> None:
    run = hapticd.simulate(config, 5.0)
    told = answer(statements(recorded(tmp_path, run, config)), "Was it stable")
    assert told.mark == ("bad" if run.outcome is Outcome.MOVING else "good")
    assert told.text.startswith("Unstable" if run.outcome is Outcome.MOVING else "Stable")
    assert judge(run.curves).stable is (told.mark == "good"), "the true position says the same"


def shaken(**pieces: float) -> Curves:
    """A device held at 0.5 mm for 4 s, that shakes from `begin` to `end` by `span_m` peak to peak at `hz`."""
    time_s = np.arange(4000) * 1e-3
    on = (time_s >= pieces["begin"]) & (time_s < pieces["end"])
    x_m = -5e-4 + np.where(on, 0.5 * pieces["span_m"] * np.sin(2.0 * np.pi * pieces["hz"] * time_s), 0.0)
    return Curves("shaken", {"t_s": time_s, "x_m": x_m, "force_n": -12e3 * x_m, "in_contact": x_m < 0.0}, 12e3)


def test_what_shakes_is_measured() -> None:
    found = judge(shaken(begin=2.0, end=3.0, span_m=4e-4, hz=40.0))
    assert not found.stable
    assert found.worst_hz == pytest.approx(40.0, abs=2.0)
    assert found.worst_m == pytest.approx(4e-4, rel=0.1)
    assert found.held_s == pytest.approx(3.5)
    assert found.shaking_s == pytest.approx(1.0)


def test_a_device_may_ring_when_it_arrives_and_a_hand_may_move() -> None:
    assert judge(shaken(begin=0.0, end=1.4, span_m=4e-4, hz=40.0)).ringing_s == pytest.approx(1.5)
    assert judge(shaken(begin=0.0, end=1.4, span_m=4e-4, hz=40.0)).stable
    assert judge(shaken(begin=0.0, end=4.0, span_m=4e-4, hz=2.0)).stable


def test_shaking_within_the_criterion_is_still_and_felt_or_not() -> None:
    fine = judge(shaken(begin=0.0, end=4.0, span_m=2e-6, hz=237.0))
    assert fine.stable
    assert fine.felt > 5.0
    assert "felt index" in fine.words
    assert judge(shaken(begin=0.0, end=0.0, span_m=0.0, hz=1.0)).felt <= 1.0


def test_a_tap_is_not_judged() -> None:
    tap = shaken(begin=0.0, end=0.0, span_m=0.0, hz=1.0)
    outside = np.where(tap["t_s"] % 0.6 < 0.3, tap["x_m"], 1e-3)
    found = judge(replace(tap, columns={**tap.columns, "x_m": outside, "in_contact": outside < 0.0}))
    assert not found.judged
    assert found.words.startswith("Not judged: it never stayed at the wall for 1 s")


def test_bouncing_out_of_the_wall_is_no_end_of_the_touch() -> None:
    assert not judge(shaken(begin=0.0, end=4.0, span_m=2e-3, hz=30.0)).stable


# -- law, machine, faults


def test_a_damping_that_made_energy_took_none(tmp_path: Path, still: Run) -> None:
    """Near rest a damper that is computed from steps of the sensor may give energy instead of taking it."""
    text = answer(
        statements(recorded(tmp_path, replace(still, dissipated_j=-3e-4, generated_j=1e-4))), "What did the law"
    )
    assert "Sampling and hold made 0.1 mJ; law and damping made another 0.3 mJ." in text.text
    assert "times as much" not in text.text


def test_a_scene_of_objects_is_not_judged_by_the_wall_that_it_lacks(tmp_path: Path) -> None:
    short = hapticd.simulate(WALL, 0.3)
    of_objects = recorded(tmp_path, short, receipt={"object_name": ["ball"]})
    (tmp_path / "wall").mkdir()
    of_a_wall = recorded(tmp_path / "wall", short)
    assert "the scene has objects" in answer(statements(of_objects), "Was it stable").text
    assert "never stayed at the wall" in answer(statements(of_a_wall), "Was it stable").text


def test_what_the_law_added_is_what_the_books_say(tmp_path: Path, still: Run) -> None:
    law = answer(statements(recorded(tmp_path, still)), "What did the law")
    share = (still.ticks - 1) / still.ticks
    assert law.numbers["generated_j"] == pytest.approx(still.generated_j * share)
    assert law.numbers["dissipated_j"] == pytest.approx(still.dissipated_j * share)
    inside = still.in_contact
    assert law.numbers["damping_max_n_s_per_m"] == still.damping_n_s_per_m[inside].max()
    assert law.numbers["displayed_stiffness_n_per_m"] == pytest.approx(12e3, rel=0.05)
    assert "of 12 kN/m" in law.text


def test_what_the_machine_did_is_counted(tmp_path: Path, still: Run) -> None:
    late_us = np.full(still.ticks, 12.0)
    late_us[17] = 4321.0
    status = [Status(timestamp=EPOCH_S + at, seq=0, overruns=count) for at, count in ((0.5, 5), (1.5, 9))]
    gap = RecordedGap(EPOCH_S + 0.3, "hapticd/position", 299, 340, 40)
    skipped = {700: 3, 1200: 1, 2900: 13}
    source = recorded(tmp_path, still, late_us=late_us, more=[gap, *status], left_out=range(300, 340), skipped=skipped)
    machine = answer(statements(source), "What did the machine")
    assert machine.mark == "bad"
    assert machine.numbers["late_max_us"] == 4321.0
    assert machine.numbers["late_median_us"] == 12.0
    assert (machine.numbers["overruns"], machine.numbers["missing"]) == (17.0, 40), "those after the last status too"
    assert "40 ticks are missing" in machine.text
    good = answer(statements(recorded(tmp_path, still)), "What did the machine")
    assert good.mark == "good"
    assert "No tick is missing" in good.text


def test_the_time_in_which_a_lost_device_was_looked_for_is_no_skipped_deadline(tmp_path: Path, still: Run) -> None:
    """The next loop begins its books anew as well."""
    more = [Event(EPOCH_S + 1.5, 1501, 204, "lost", {}), Event(EPOCH_S + 3.3, 1501, 100, "the loop runs", {})]
    source = recorded(tmp_path, still, more=more, skipped={300: 2, 1500: 1800})
    machine = answer(statements(source), "What did the machine")
    assert machine.numbers["overruns"] == 2.0
    assert source.recording is not None
    energy = source.recording.topics["energy"]
    anew = np.where(np.arange(still.ticks) > 1500, energy["generated_j"] - energy["generated_j"][1501], 0.0)
    begun = np.where(np.arange(still.ticks) > 1500, anew, energy["generated_j"])
    topics = {**source.recording.topics, "energy": {**energy, "generated_j": begun}}
    law = answer(statements(replace(source, recording=replace(source.recording, topics=topics))), "What did the law")
    assert law.numbers["generated_j"] == pytest.approx(still.generated_j * (still.ticks - 2) / still.ticks)


def test_without_the_timing_the_statuses_say_what_was_skipped_and_a_restart_counts_from_0(
    tmp_path: Path, still: Run
) -> None:
    counts = ((0.5, 5), (1.5, 9), (2.0, 6), (2.5, 8))
    source = recorded(tmp_path, still, more=[Status(timestamp=EPOCH_S + at, overruns=count) for at, count in counts])
    assert source.recording is not None
    topics = {name: table for name, table in source.recording.topics.items() if name != "timing"}
    topics["status"] = {**topics["status"], "run": np.array([0, 0, 1, 1])}
    alone = replace(source, recording=replace(source.recording, topics=topics))
    assert answer(statements(alone), "What did the machine").numbers["overruns"] == 4.0 + 8.0


def test_a_fault_is_named_with_its_time(tmp_path: Path, still: Run) -> None:
    fault = Event(EPOCH_S + 1.25, 1250, 201, "over-speed: 3 m/s", {})
    told = statements(recorded(tmp_path, still, more=[fault]))
    assert answer(told, "Was there a fault").mark == "bad"
    assert answer(told, "Was there a fault").text == "One at 1.25 s: over-speed: 3 m/s (code 201)."
    assert answer(statements(recorded(tmp_path, still)), "Was there a fault").text == "None."


def test_a_fault_that_only_the_statuses_tell_of_is_named_as_well(tmp_path: Path, still: Run) -> None:
    fault: dict[str, Any] = {"fault_code": 202, "fault_text": "over-speed: 3 m/s", "latched": True}
    within = Status(timestamp=EPOCH_S + 1.5, seq=1500, fault_timestamp=EPOCH_S + 1.25, **fault)
    told = answer(statements(recorded(tmp_path, still, more=[within])), "Was there a fault")
    assert (told.mark, told.text) == ("bad", "One at 1.25 s: over-speed: 3 m/s (code 202).")
    before = Status(timestamp=EPOCH_S + 0.5, seq=500, fault_timestamp=EPOCH_S - 9.0, **fault)
    told = answer(statements(recorded(tmp_path, still, more=[before])), "Was there a fault")
    assert told.mark == "bad"
    assert told.text == "None, but it was stopped by one from before, at 0.50 s: over-speed: 3 m/s (code 202)."
    cleared = replace(before, latched=False, armed=True)
    assert answer(statements(recorded(tmp_path, still, more=[cleared])), "Was there a fault").mark == "good"


def test_a_wall_that_changed_meanwhile_has_no_one_stiffness(tmp_path: Path, still: Run) -> None:
    stiffer = Status(timestamp=EPOCH_S + 2.0, seq=2000, armed=True, wall_stiffness_n_per_m=(14e3,))
    text = answer(statements(recorded(tmp_path, still, more=[stiffer])), "What did the law").text
    assert " kN/m in the median" in text
    assert "of 12 kN/m" not in text


# -- a wall without force


TRIPPED = """
[device.options]
model = "omega7"
initial_position_m = 0.0005
[device.options.hand]
force = { profile = "ramp", from_newton = 0.3, newton = -3.0, at_s = 1.0, duration_s = 0.4 }
stiffness_n_per_m = 600.0
damping_n_s_per_m = 3.0
[[scene.walls]]
stiffness_n_per_m = 30000.0
[controller]
law = "none"
[safety]
max_speed_m_per_s = 0.06
"""


@pytest.fixture(scope="module")
def tripped() -> Run:
    """So unstable that the first touch is a fault; then the handle rests inside the wall, without force."""
    run = hapticd.simulate(hapticd.load(TRIPPED), 6.0)
    assert run.outcome is Outcome.STOPPED
    return run


def fault_of(run: Run) -> Event:
    assert run.fault is not None
    at_s = float(run.fault.split()[0])
    return Event(EPOCH_S + at_s, round(at_s * 1e3), 202, "over-speed", {})


def test_a_wall_that_trips_the_speed_limit_is_not_stable_for_the_rest_after_it(tmp_path: Path, tripped: Run) -> None:
    fault = fault_of(tripped)
    told = statements(open_source(write_recording(tmp_path / "trip.mcap", tripped, TRIPPED, more=[fault])))
    stable = answer(told, "Was it stable")
    assert stable.mark == "bad"
    assert stable.text.startswith(f"Stopped: a fault ended a touch of the wall at {fault.timestamp - EPOCH_S:.2f} s")
    assert "s inside the wall without force are not judged." in stable.text
    assert (stable.numbers["held_s"], stable.numbers["faulted"]) == (0.0, 1)
    shown = answer(told, "What did the law").numbers["displayed_stiffness_n_per_m"]
    assert shown == pytest.approx(30e3, rel=0.1), "the rest shows 0"


@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_the_same_run_in_a_file_of_simulate_is_judged_up_to_where_it_stopped(
    tmp_path: Path, tripped: Run, suffix: str
) -> None:
    path = tmp_path / f"trip.{suffix}"
    if suffix == "npz":
        np.savez(path, allow_pickle=False, **{name: np.asarray(column) for name, column in tripped.columns.items()})
    else:
        table = np.column_stack([np.asarray(column, float) for column in tripped.columns.values()])
        np.savetxt(path, table, delimiter=",", header=",".join(tripped.columns), comments="")
    told = statements(open_source(path))
    assert answer(told, "Was it stable").mark == "bad"
    assert answer(told, "What did the law").numbers["displayed_stiffness_n_per_m"] == pytest.approx(30e3, rel=0.1)


def test_a_daemon_that_was_stopped_all_the_time_says_nothing_of_its_wall(tmp_path: Path, tripped: Run) -> None:
    latched = Status(
        timestamp=EPOCH_S, seq=0, latched=True, fault_code=202, fault_text="over-speed", fault_timestamp=EPOCH_S - 60.0
    )
    source = open_source(write_recording(tmp_path / "trip.mcap", tripped, TRIPPED, more=[latched]))
    told = statements(source)
    assert [one.mark for one in told[:3]] == ["unknown", "unknown", "bad"]
    assert answer(told, "Was it stable").text.startswith("Not judged")
    assert answer(told, "What did the law").text == "No force was let through at the wall."


def test_a_touch_that_was_still_when_a_fault_came_is_neither_stable_nor_unstable(tmp_path: Path, still: Run) -> None:
    told = statements(recorded(tmp_path, still, more=[Event(EPOCH_S + 2.5, 2500, 204, "lost", {})]))
    stable = answer(told, "Was it stable")
    assert stable.mark == "unknown"
    assert stable.text.startswith("A fault ended a touch of the wall at 2.50 s. Held: ")


def test_what_is_disarmed_on_request_is_stable_for_as_long_as_it_was_armed(tmp_path: Path, still: Run) -> None:
    """Armed again the handle arrives anew, so that half a second more is not judged."""
    events = [
        Event(EPOCH_S, 0, 100, "the loop runs", {}),
        Event(EPOCH_S, 0, 101, "armed", {}),
        Event(EPOCH_S + 1.7, 1700, 102, "disarmed", {}),
        Event(EPOCH_S + 1.9, 1900, 101, "armed", {}),
    ]
    whole = answer(statements(recorded(tmp_path, still)), "Was it stable")
    source = recorded(tmp_path, still, more=events)
    assert source.recording is not None
    armed = source.recording.armed
    assert np.flatnonzero(np.diff(armed)).tolist() == [1700, 1900]
    assert armed[0]
    stable = answer(statements(source), "Was it stable")
    assert (whole.mark, stable.mark) == ("good", "good")
    assert stable.numbers["forceless_s"] == pytest.approx(0.2, rel=1e-3)
    held_s, whole_s = stable.numbers["held_s"], whole.numbers["held_s"]
    assert held_s is not None
    assert whole_s is not None
    assert 0.0 < held_s <= whole_s - 0.7


def test_what_happened_is_told_in_order_of_time(tmp_path: Path, still: Run) -> None:
    more = [
        Note(EPOCH_S + 2.0, "recording stopped"),
        Event(EPOCH_S + 0.5, 500, 111, "go", {}),
        Event(EPOCH_S + 1.5, 1500, 204, "lost", {}),
        Event(EPOCH_S + 1.0, 1000, 103, "none -> tdpa", {}),
    ]
    recording = recorded(tmp_path, still, more=more).recording
    assert recording is not None
    assert [(one.time_s, one.kind, one.text) for one in timeline(recording)] == [
        (0.5, "marker", "go"),
        (1.0, "event", "none -> tdpa (code 103)"),
        (1.5, "fault", "lost (code 204)"),
        (2.0, "recorder", "recording stopped"),
    ]


# -- the page


class Seen(HTMLParser):
    """Tags, attributes and texts as a browser would take them."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += data


def shown(source: Source) -> Seen:
    return Seen(page(source, statements(source)).decode())


def test_hostile_texts_of_a_recording_stay_texts(tmp_path: Path, still: Run) -> None:
    receipt = dict.fromkeys(("device", "law", "kernel", "config_file", "serial"), HOSTILE)
    told = HOSTILE.replace("\ud800", "")  # what cannot be encoded never gets into a recording
    more: list[Event | Note] = [
        Event(EPOCH_S + 1.0, 1000, 201, told, {}),
        Event(EPOCH_S + 1.1, 1100, 111, told, {}),
        Note(EPOCH_S + 1.2, told),
    ]
    receipt = {key: text.replace("\ud800", "").replace("\x00", "") for key, text in receipt.items()}
    config = WALL.read_text() + '\n# </pre><script src="http://127.0.0.1/x.js"></script>\n'
    path = write_recording(tmp_path / "<b>&x.mcap", still, config, more=more, receipt=receipt)
    seen = shown(open_source(path))
    plain = Seen(page(recorded(tmp_path, still), statements(recorded(tmp_path, still))).decode())
    assert set(seen.tags) <= set(plain.tags) | {"tr", "th"}, "a tag that no page has came from the recording"
    assert seen.text.count('</td><script>alert("1")</script><img src=x onerror=alert(2)>&lt;b&gt;') >= 8
    assert not re.search("[\x00\x1b\u202e]", seen.text)
    assert "<b>&x.mcap" in seen.text
    assert '</pre><script src="http://127.0.0.1/x.js"></script>' in seen.text


def test_the_page_holds_everything_and_asks_for_nothing(tmp_path: Path, still: Run) -> None:
    seen = shown(recorded(tmp_path, still))
    assert not {"script", "link", "iframe", "object", "embed", "form", "base", "svg"} & set(seen.tags)
    assert not [name for name, _ in seen.attributes if name.startswith("on") or name in ("href", "srcset", "style")]
    sources = [value for name, value in seen.attributes if name == "src"]
    assert len(sources) == 4
    for one in sources:
        head, _, content = one.partition(",")
        assert head == "data:image/svg+xml;base64"
        drawn = ElementTree.fromstring(base64.b64decode(content))
        references = [value for each in drawn.iter() for key, value in each.attrib.items() if key.endswith("href")]
        assert all(value.startswith(("#", "data:")) for value in references)
        assert not [each for each in drawn.iter() if each.tag.endswith("script")]
    policy = next(value for _, value in seen.attributes if value.startswith("default-src"))
    assert policy == "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    assert "url(" not in page(recorded(tmp_path, still), []).decode()


def test_the_page_is_its_own_receipt(tmp_path: Path, still: Run) -> None:
    seen = shown(recorded(tmp_path, still))
    assert WALL.read_text().strip() in seen.text
    for said in ("6.1.0", "energy-cycle", "loopback", "/etc/lab.toml", "wall_stiffness_n_per_m12000.0"):
        assert said in seen.text


def test_a_thousand_events_do_not_make_an_endless_page(tmp_path: Path, still: Run) -> None:
    many = [Event(EPOCH_S + at * 1e-3, at, 103, f"event {at}", {}) for at in range(MOST_LINES + 7)]
    assert "7 more are in the recording." in shown(recorded(tmp_path, still, more=many)).text


numbers = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-0.01, 0.01)


@examples(100)
@given(
    rows=st.lists(st.tuples(numbers, numbers, numbers, numbers), min_size=1, max_size=40),
    step_s=st.sampled_from([1e-3, 1e-9, 0.2, 1e9]),
)
def test_whatever_numbers_a_file_holds_there_is_a_verdict_or_a_reason(
    rows: list[tuple[float, ...]], step_s: float
) -> None:
    columns = np.array(rows).T
    held = {"t_s": np.arange(len(rows)) * step_s, "in_contact": columns[3] < 0.0}
    named = dict(zip(("x_m", "force_n", "energy_j", "damping_n_s_per_m"), columns, strict=True))
    if (np.abs(columns) <= 1e15).all():
        told = statements(Source("wild.csv", (Curves("wild.csv", {**held, **named}),), None))
        assert json.dumps([one.numbers for one in told], allow_nan=False)
    else:
        with pytest.raises(HapticdError, match=r"^wild\.csv: \w+ is \S+ in row \d+: nothing to draw"):
            Curves("wild.csv", {**held, **named})


def test_times_that_do_not_rise_are_refused_before_anything_divides_by_them() -> None:
    with pytest.raises(HapticdError, match="its times do not rise"):
        Curves("still.csv", {"t_s": [1.0, 1.0, 1.0], "x_m": [0.0] * 3, "force_n": [0.0] * 3})


@pytest.mark.parametrize("name", ["run.csv", "run.npz"])
def test_a_simulated_run_has_its_report_too(name: str, tmp_path: Path) -> None:
    config = CONFIG / "wall-12-none.toml"
    command = [HAPTICD, "simulate", "--config", str(config), "--duration", "3", "--output", str(tmp_path / name)]
    subprocess.run(command, check=True, capture_output=True)
    output = tmp_path / "run.html"
    command = [HAPTICD, "report", str(tmp_path / name), "--output", str(output)]
    done = subprocess.run([*command, "--json"], check=True, capture_output=True, text=True)
    told = json.loads(done.stdout)["statements"]
    assert [one["mark"] for one in told] == ["bad", "good"]
    assert told[0]["numbers"]["worst_hz"] == pytest.approx(28.0, abs=3.0)
    assert "a file of hapticd simulate holds the columns alone" in Seen(output.read_text()).text
    again = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (again.returncode, again.stderr) == (2, f"hapticd: {output}: exists; add --overwrite to replace it\n")


def test_the_command_says_the_verdict_without_a_page(tmp_path: Path, still: Run) -> None:
    path = write_recording(tmp_path / "run.mcap", still, WALL.read_text())
    done = subprocess.run([HAPTICD, "report", str(path)], check=True, capture_output=True, text=True)
    assert done.stdout.startswith("Was it stable? Stable: 2.5 s at the wall without shaking by more than 0.05 mm")
    assert [line.split("?")[0] for line in done.stdout.splitlines()] == [
        "Was it stable", "What did the law add", "Was there a fault", "What did the machine do",
    ]  # fmt: skip
