"""A recorded hand under other laws: the same law gives the same forces, an unstable run is calmed by those that can."""

from __future__ import annotations

import csv
import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hapticd.config.loading import LoadedConfig, load
from hapticd.errors import ConfigError, HapticdError
from hapticd.plugins import CONTROLLERS, names
from hapticd.simulation.options import SimulationOptions
from hapticd_views.recording import read
from hapticd_views.replay.hand import identify
from hapticd_views.replay.motion import replay_motion
from hapticd_views.replay.replay import Replay, replay
from hapticd_views.replay.stretch import longest_stretch
from tests.daemon.running import HAPTICD
from tests.views.replay.simulated import record

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
