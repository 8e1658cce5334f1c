"""`hapticd plot --figure scene`: the path of a run among the objects of its scene."""

from __future__ import annotations

import math
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.config.loading import load
from hapticd.errors import ConfigError
from hapticd_views.recording import read
from hapticd_views.scene import scene
from hapticd_views.source import Source, open_source
from tests.daemon.running import HAPTICD
from tests.views.replay.simulated import record

BALL = Path(__file__).parents[2] / "config" / "ball.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("runs") / "ball.csv"
    command = [HAPTICD, "simulate", "--config", str(BALL), "--duration", "0.4", "--output", str(file)]
    subprocess.run(command, check=True, capture_output=True)
    return file


def test_the_device_is_drawn_where_it_was_and_its_proxy_on_the_ball(run: Path) -> None:
    figure = scene(open_source(run), run, BALL, 0.0, math.inf, "ball")
    front = figure.axes[1]  # x and z, through the point of the ball that was pressed
    path, _, proxy, _ = (np.array(line.get_data()) for line in front.lines)
    columns = np.genfromtxt(run, delimiter=",", names=True)
    assert path[0] == pytest.approx(1e3 * columns["position_x_m"])
    assert path[1] == pytest.approx(1e3 * columns["position_z_m"])
    held = np.isfinite(proxy[0])
    assert held.sum() > 100
    assert np.hypot(*proxy[:, held]) == pytest.approx(30.0, abs=2e-3)


def test_a_stretch_is_cut_out(run: Path) -> None:
    figure = scene(open_source(run), run, BALL, 0.1, 0.2, "")
    assert np.size(figure.axes[0].lines[0].get_xdata()) == 101


def test_a_recording_that_was_reloaded_is_drawn_among_the_objects_that_were_there(tmp_path: Path) -> None:
    """It was drawn among those of its beginning: a ball that is larger from then on held nothing."""
    record(tmp_path / "ball.mcap", load(BALL), 400)
    made = read(tmp_path / "ball.mcap")
    larger = BALL.read_text().replace("radius_m = 0.03", "radius_m = 0.032")
    later = {**made.receipt, "timestamp": made.ticks["timestamp"][200], "config_text": larger, "config_hash": "larger"}
    made = replace(made, receipts=(made.receipt, later))
    source = Source("ball.mcap", (), made)
    with pytest.raises(ConfigError, match=r"objects changed at 0\.19950 s: draw it with --to or --from"):
        scene(source, made.path, None, 0.0, math.inf, "")
    for from_s, to_s, radius_mm in ((0.0, 0.1995, 30.0), (0.1995, math.inf, 32.0)):
        figure = scene(source, made.path, None, from_s, to_s, "")
        path, _, proxy, _ = (np.array(line.get_data()) for line in figure.axes[1].lines)
        assert path.shape[1] == 200
        held = np.isfinite(proxy[0])
        assert held.sum() > 20
        assert np.hypot(*proxy[:, held]) == pytest.approx(radius_mm, abs=2e-3)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ((), "ball.csv: which scene? give the configuration that was run: --config FILE"),
        (("--contact",), "--figure scene: draws one run, from --from to --to"),
        (("--config", str(BALL), "--from", "9"), "ball.csv: no tick from 9 s to inf s"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(
    run: Path, tmp_path: Path, more: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["plot", str(run), "--figure", "scene", "--output", str(tmp_path / "a.png"), *more])
    assert end.value.code == 2
    assert capsys.readouterr().err.strip() == f"hapticd: {said}"


def test_the_command_writes_a_picture(run: Path, tmp_path: Path) -> None:
    picture = tmp_path / "ball.png"
    arguments = ["plot", str(run), "--figure", "scene", "--config", str(BALL), "--to", "0.1", "--output", str(picture)]
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert not end.value.code
    assert picture.read_bytes().startswith(b"\x89PNG")
