"""A recorded hand under other laws: the same law gives the same forces, an unstable run is calmed by those that can."""

from __future__ import annotations

import csv
import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd.config.loading import LoadedConfig, load
from hapticd.errors import ConfigError, HapticdError
from hapticd.plugins import CONTROLLERS, names
from hapticd.simulation.options import SimulationOptions
from hapticd.telemetry.records import Event, Status, Touch
from hapticd.tick.event import EventCode
from hapticd_views.recording import read
from hapticd_views.replay.begun import begun
from hapticd_views.replay.hand import identify
from hapticd_views.replay.motion import replay_motion
from hapticd_views.replay.replay import Replay, replay
from hapticd_views.replay.stretch import longest_stretch
from tests.daemon.running import HAPTICD
from tests.views.replay.simulated import BEGAN_S, record

UNSTABLE = Path("config/wall-12-none.toml")


def pressed(law: str, stiffness_n_per_m: float, **options: object) -> LoadedConfig:
    """A hand that presses and lets go, from outside of the wall."""
    values: dict[str, object] = {
        "device.options.initial_position_m": 0.001,
        "device.options.hand.force": {
            "profile": "press-and-release", "newton": -3.0, "release_newton": 0.5, "period_s": 0.5,
        },
        "scene.walls[0].stiffness_n_per_m": stiffness_n_per_m,
        "controller.law": law,
    }  # fmt: skip
    return load(UNSTABLE).with_values({**values, **{f"device.options.{key}": value for key, value in options.items()}})


@pytest.fixture(scope="module")
def unstable(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("made") / "unstable.mcap"
    record(path, load(UNSTABLE), 2000)
    return path


@pytest.mark.parametrize("law", names(CONTROLLERS))
def test_the_recorded_motion_under_the_recorded_law_gives_the_recorded_forces(tmp_path: Path, law: str) -> None:
    path = tmp_path / "run.mcap"
    record(path, pressed(law, 6000.0), 1200)
    recorded, again = replay(path, laws=[law], hand="motion").traces
    assert np.array_equal(np.asarray(again.force_n), recorded.force_n)
    assert np.array_equal(np.asarray(again.force_requested_n), recorded.force_requested_n)
    assert np.array_equal(np.asarray(again.damping_n_s_per_m), recorded.damping_n_s_per_m)
    assert np.abs(recorded.force_n).max() > 1.0


def test_the_force_of_the_hand_is_found(tmp_path: Path) -> None:
    config = pressed("none", 2000.0)
    record(tmp_path / "run.mcap", config, 2000)
    found = replay(tmp_path / "run.mcap", laws=["none"])
    time_s = np.arange(2000) * 1e-3
    meant_n = 0.5 + (0.5 - 0.5 * np.cos(2.0 * np.pi * time_s / 0.5)) * -3.5
    inner = slice(100, -100)  # a smoother knows least where the record begins and ends
    assert np.sqrt(np.mean((found.force_n - meant_n)[inner] ** 2)) < 0.1
    # And the loop that it closes is the recorded one.
    again = found.scores[1]
    assert again.position_off_m < 1e-4
    assert again.peak_force_n == pytest.approx(found.scores[0].peak_force_n, rel=0.05)


@pytest.mark.parametrize(
    "options",
    [
        {"force_delay_samples": 2},
        {"bandwidth_hz": 100.0},
        {"max_force_n": 2.0},
        {"hand.mass_kg": 0.3, "hand.damping_n_s_per_m": 2.0, "hand.stiffness_n_per_m": 50.0},
        {"noise_m": 2e-6},
        {"resolution_m": 0.0},
    ],
)
def test_what_the_model_knows_is_not_taken_for_the_hand(tmp_path: Path, options: dict[str, float]) -> None:
    config = pressed("none", 1000.0, **options)
    record(tmp_path / "run.mcap", config, 1500)
    found = replay(tmp_path / "run.mcap", laws=["none"])
    meant_n = 0.5 + (0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(1500) / 500.0)) * -3.5
    assert np.sqrt(np.mean((found.force_n - meant_n)[100:-100] ** 2)) < 0.15


def test_a_hand_that_is_faster_than_the_bandwidth_is_not_followed() -> None:
    """A step is met half way at its time, and in full within one over the bandwidth."""
    device = load(UNSTABLE).options
    assert isinstance(device, SimulationOptions)
    x_m = [0.5 * 4.0 * max(0.0, at - 1000) ** 2 * 1e-6 for at in range(2000)]  # a push of 1 N on 0.25 kg from 1 s on
    model = device.model_copy(update={"viscous_n_s_per_m": 0.0, "resolution_m": 1e-6})
    slow = identify(x_m, [0.0] * 2000, model, 1e-3, 5.0).force_n
    assert slow[1000] == pytest.approx(0.5, abs=0.1)
    assert np.abs(slow[500:800]).max() < 0.1
    assert slow[1200:1800] == pytest.approx(1.0, abs=0.1)


def test_an_unstable_run_under_every_law_is_one_table_and_one_figure(unstable: Path, tmp_path: Path) -> None:
    made = {}
    for suffix in ("csv", "npz", "svg"):
        output = tmp_path / f"laws.{suffix}"
        done = simulate("--replay", unstable, "--output", output, *(["--json"] if suffix == "npz" else []))
        assert done.returncode == 0, done.stderr
        made[suffix] = output, done.stdout
    laws = ["recorded", "none", *(law for law in names(CONTROLLERS) if law != "none")]
    rows = [line.split() for line in made["csv"][1].splitlines()]
    assert [row[0] for row in rows[4 : 4 + len(laws)]] == laws
    told = {row["law"]: row for row in json.loads(made["npz"][1])["laws"]}
    assert list(told) == laws
    # Without a law the run is the recorded one again; what damps brings it to rest.
    assert told["none"]["shaking_m"] == pytest.approx(told["recorded"]["shaking_m"], rel=0.05)
    assert told["none"]["generated_j"] == pytest.approx(told["recorded"]["generated_j"], rel=0.05)
    for law in ("damper", "energy-cycle", "ring-damping", "tdpa"):
        assert told[law]["shaking_m"] < 0.25 * told["none"]["shaking_m"], law
        assert told[law]["generated_j"] < 0.1 * told["none"]["generated_j"], law
    with np.load(made["npz"][0]) as columns:
        assert {f"{law}.x_m" for law in laws} | {"t_s", "hand_n"} <= set(columns)
        wanted = columns["tdpa.force_n"].tolist()
    with made["csv"][0].open(newline="") as file:
        assert [float(row["tdpa.force_n"]) for row in csv.DictReader(file)] == wanted
    svg = made["svg"][0].read_text()
    assert svg.startswith("<?xml")
    assert svg.count("<!-- recorded") <= 1
    assert all(f"<!-- {law} -->" in svg for law in laws[1:])


def test_the_longest_stretch_without_a_gap_is_replayed(tmp_path: Path) -> None:
    config = pressed("none", 6000.0)
    record(tmp_path / "run.mcap", config, 1500, skip=(500, 502))
    made = replay(tmp_path / "run.mcap", laws=["none"], hand="motion")
    recording = read(tmp_path / "run.mcap")
    first = int(recording.ticks["seq"][500]) + round((made.first_s - 0.502) * 1e3)
    assert first >= 502
    assert len(made.traces[0].x_m) == 1500 - first
    assert not made.in_contact
    short = replay(tmp_path / "run.mcap", laws=["none"], hand="motion", duration_s=0.3)
    assert short.duration_s == pytest.approx(0.301)


def test_what_is_disarmed_or_tared_is_no_part_and_what_comes_behind_it_is_another_one(tmp_path: Path) -> None:
    """A replay over a tare saw the handle jump by 10 mm and called for a fault of over-speed."""
    orders = {900: "disarm", 1000: "tare", 1100: "arm"}
    record(tmp_path / "run.mcap", pressed("none", 3000.0), 2600, orders=orders, told_every=200)
    recording = read(tmp_path / "run.mcap")
    assert np.flatnonzero(np.diff(recording.armed)).tolist() == [900, 1100]
    made = replay(tmp_path / "run.mcap", laws=["none"], hand="motion")
    recorded, again = made.traces
    assert made.first_s >= 1.1
    assert np.array_equal(np.asarray(again.force_n), recorded.force_n)
    assert np.abs(recorded.force_n).max() > 1.0
    assert not again.fault
    closed = replay(tmp_path / "run.mcap", laws=["none"]).scores[1]
    assert closed.position_off_m < 1e-4


def test_a_device_that_was_lost_is_replayed_before_or_after(tmp_path: Path) -> None:
    """`seq` goes on, and nothing but the pause and the start of the next loop tells."""
    path = tmp_path / "run.mcap"
    record(path, pressed("none", 3000.0), 1500, pause=(1000, 1.8))
    assert len(longest_stretch(read(path))) <= 1000
    events = [Event(BEGAN_S + 1.0, 1000, EventCode.STARTED, ""), Event(BEGAN_S + 1.0, 1000, EventCode.ARMED, "")]
    record(path, pressed("none", 3000.0), 1500, more=events)
    assert len(longest_stretch(read(path))) <= 1000
    assert read(path).armed[1000]
    record(path, pressed("none", 3000.0), 1500, more=[Event(BEGAN_S + 0.4, 400, EventCode.SWITCHED, "")])
    assert longest_stretch(read(path)).first_s > 0.4
    record(path, pressed("none", 3000.0), 1500, more=[Event(BEGAN_S + 0.9, 900, EventCode.DEVICE_LOST, "")])
    assert len(longest_stretch(read(path))) <= 900


def test_without_any_force_there_is_nothing_to_replay(tmp_path: Path) -> None:
    events = [Event(BEGAN_S, 0, EventCode.STARTED, "the loop runs")]
    record(tmp_path / "run.mcap", pressed("none", 3000.0), 300, more=events)
    with pytest.raises(HapticdError, match="no forces were let through: there is nothing to replay"):
        replay(tmp_path / "run.mcap", laws=["none"], hand="motion")


CHANGING = (
    {"at_s": 0.5, "stiffness_n_per_m": 2000.0, "damping_n_s_per_m": 4.0}, {"at_s": 1.4, "stiffness_n_per_m": 4000.0},
)  # fmt: skip


@pytest.mark.parametrize("begins", [0, 300, 600, 1500])
def test_a_wall_is_where_its_changes_had_come_when_the_recording_began(tmp_path: Path, begins: int) -> None:
    """A wall that had become stiffer before was replayed as soft as in the file, and changed 2 s too late."""
    config = pressed("none", 3000.0).with_values({"scene.walls[0].changes": CHANGING})
    record(tmp_path / "run.mcap", config, 2000, skip=(0, begins), told_every=100)
    recorded, again = replay(tmp_path / "run.mcap", laws=["none"], hand="motion").traces
    assert np.array_equal(np.asarray(again.force_n), recorded.force_n)
    assert np.abs(recorded.force_n).max() > 1.0
    was, closed = replay(tmp_path / "run.mcap", laws=["none"]).scores
    assert closed.stiffness_n_per_m == pytest.approx(was.stiffness_n_per_m, rel=0.05)


def test_a_wall_whose_statuses_tell_another_time_is_refused(tmp_path: Path) -> None:
    """As where a device was lost, or a reload brought the wall, before the recording began."""
    config = pressed("none", 3000.0).with_values({"scene.walls[0].changes": CHANGING})
    stiff = Status(
        timestamp=BEGAN_S + 1.8, seq=1800, ticks=1801, armed=True, wall_stiffness_n_per_m=(3000.0,), wall_axis=("z",),
        wall_position_m=(0.0,),
    )  # fmt: skip
    record(tmp_path / "run.mcap", config, 2000, more=[stiff])
    with pytest.raises(HapticdError, match=r"scene.walls\[0\] changes over time, and how far it had come is not told"):
        replay(tmp_path / "run.mcap", laws=["none"], hand="motion")
    plain = tmp_path / "plain.toml"
    plain.write_text(pressed("none", 4000.0).text)
    assert replay(tmp_path / "run.mcap", plain, laws=["none"], hand="motion").scores


def test_a_reload_that_brought_the_wall_is_told_by_the_stiffness(tmp_path: Path) -> None:
    """The wall counts from the tick behind it: here as if the loop had begun 700 ticks earlier."""
    config = pressed("none", 3000.0).with_values({"scene.walls[0].changes": CHANGING})
    path = tmp_path / "run.mcap"
    record(path, config, 1600, told_every=100)
    recording = read(path)
    later = {name: {**table, "seq": table["seq"] + 700} for name, table in recording.topics.items()}
    later["status"]["ticks"] = later["status"]["ticks"] + 700
    event = {
        "timestamp": np.array([BEGAN_S]), "seq": np.array([699]), "run": np.array([0]),
        "code": np.array([int(EventCode.SWITCHED)]), "text": ["reloaded"], "fields": [{}],
    }  # fmt: skip
    moved = replace(recording, topics={**later, "event": event})
    stretch = longest_stretch(moved)
    wall = begun(moved, stretch, config).config.scene.walls[0]
    again = begun(recording, longest_stretch(recording), config).config.scene.walls[0]
    assert wall == again


def test_where_clients_took_part_is_not_replayed(tmp_path: Path) -> None:
    """Their force is in what was recorded, and no law of the replay has it."""
    path = tmp_path / "run.mcap"
    config = pressed("none", 3000.0)
    pushed = [Touch(BEGAN_S + seq * 1e-3, seq, (1.5,), remote=0, remote_seq=7) for seq in range(1500)]
    record(path, config, 1500, more=pushed[:1000])
    assert longest_stretch(read(path)).first_s >= 1.0
    record(path, config, 1500, more=pushed)
    with pytest.raises(HapticdError, match="clients had a part in every force: there is nothing to replay"):
        replay(path, laws=["none"])
    remote: dict[str, Any] = {"armed": True, "remote_name": ("field",), "remote_kind": ("force",)}
    owned = Status(timestamp=BEGAN_S, seq=0, remote_owner=("somebody",), remote_messages=(3,), **remote)
    record(path, config, 500, more=[owned])
    with pytest.raises(HapticdError, match="has no topic 'contact'"):
        replay(path, laws=["none"])
    free = replace(owned, remote_owner=("",))
    record(path, config, 500, more=[free])
    assert replay(path, laws=["none"], hand="motion").scores
    record(path, config, 500, more=[replace(free, remote_kind=("object",))])
    with pytest.raises(HapticdError, match="clients moved 'field', and a replay does not know where it is"):
        replay(path, laws=["none"])


def test_what_the_law_had_learned_before_is_said_to_be_missing(tmp_path: Path) -> None:
    config = pressed("energy-cycle", 6000.0)
    record(tmp_path / "run.mcap", config, 1600)
    assert not replay(tmp_path / "run.mcap", laws=["energy-cycle"], hand="motion").learned
    record(tmp_path / "run.mcap", config, 1600, skip=(0, 700))
    made = replay(tmp_path / "run.mcap", laws=["energy-cycle"], hand="motion")
    assert made.learned
    assert any("had learned" in line for line in made.lines)


def test_a_part_is_replayed_on_its_own_axes_where_another_part_has_more(tmp_path: Path) -> None:
    """As when the daemon came back with another device: the columns are as wide as the widest part."""
    config = pressed("none", 6000.0)
    record(tmp_path / "run.mcap", config, 400)
    recording = read(tmp_path / "run.mcap")
    alone = longest_stretch(recording)
    names = ("position_m", "velocity_m_per_s", "force_n", "force_requested_n")
    position = recording.topics["position"]
    wide = {name: np.pad(position[name], ((0, 0), (0, 2)), constant_values=np.nan) for name in names}
    beside = longest_stretch(replace(recording, topics={**recording.topics, "position": {**position, **wide}}))
    assert replay_motion(beside, config).force_n == replay_motion(alone, config).force_n


def test_a_recording_of_a_real_device_needs_a_model_or_replays_its_motion(tmp_path: Path) -> None:
    record(tmp_path / "run.mcap", pressed("none", 6000.0), 600)
    model = tmp_path / "model.toml"
    model.write_text(pressed("tdpa", 6000.0).text)
    made = replay(tmp_path / "run.mcap", model, laws=["tdpa", "none"])
    assert [score.law for score in made.scores] == ["recorded", "tdpa", "none"]
    wrong = tmp_path / "real.toml"
    wrong.write_text(
        '[device]\ndriver = "omega7"\n[safety]\nmax_force_n = 5.0\n[[scene.walls]]\nstiffness_n_per_m = 6e3\n'
    )
    with pytest.raises(ConfigError, match="name a --config with a model of the device, or replay the motion"):
        replay(tmp_path / "run.mcap", wrong, laws=["none"])
    assert isinstance(replay(tmp_path / "run.mcap", wrong, laws=["none"], hand="motion"), Replay)


def test_what_cannot_be_replayed_is_said_in_one_line(unstable: Path, tmp_path: Path) -> None:
    (tmp_path / "junk.mcap").write_text("junk")
    other = tmp_path / "other.toml"
    other.write_text("[loop]\nrate_hz = 2000.0\n[[scene.walls]]\nstiffness_n_per_m = 1e3\n")
    for words, code, arguments in (
        ("is no MCAP file", 1, ("--replay", tmp_path / "junk.mcap")),
        ("a recording ends in .mcap", 2, ("--replay", tmp_path / "run.csv")),
        ('"nothing": not installed', 2, ("--replay", unstable, "--law", "nothing")),
        ("must be force or motion", 2, ("--replay", unstable, "--hand", "left")),
        ("was recorded at 1000 Hz", 2, ("--replay", unstable, "--config", other)),
        ("must end in .csv, .npz, .png, .svg, .pdf", 2, ("--replay", unstable, "--output", tmp_path / "a.txt")),
        ("needs --config and --duration, or --replay", 2, ()),
        ("--law goes with --replay", 2, ("--config", UNSTABLE, "--duration", "1", "--law", "tdpa")),
    ):
        done = simulate(*arguments)
        assert (done.returncode, words in done.stderr) == (code, True), done.stderr
        assert "defect" not in done.stderr
    record(tmp_path / "thin.mcap", load(UNSTABLE), 100, every_ticks=4)
    with pytest.raises(HapticdError, match="one tick in 4"):
        replay(tmp_path / "thin.mcap")


def simulate(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([HAPTICD, "simulate", *arguments], capture_output=True, text=True, check=False)
