"""`hapticd study space`: exact limits against closed forms, and against the loop's own proxy, stepped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.simulation.space.linkage import mass_matrix
from hapticd_studies.space.linear import SpaceLoop, surface_stiffness
from hapticd_studies.space.places import KINDS, draw
from hapticd_studies.space.stepping import settles
from hapticd_studies.space.study import look

LIGHT = np.eye(3)


def loop(mass: list[float], damping: float = 4.0, delay: int = 0) -> SpaceLoop:
    return SpaceLoop(np.diag(mass), damping * np.eye(3), LIGHT, 1e-3, delay)


@pytest.mark.parametrize(("turn_deg", "limit_n_per_m"), [(0, 8050), (45, 11600), (90, 8010)])
def test_a_device_that_is_heavy_one_way_is_strongest_askew(turn_deg: float, limit_n_per_m: float) -> None:
    """M diag(0.1, 0.5) kg, B 4 N s/m at 1 kHz: an oblique surface drives both axes against each other."""
    found = look(loop([0.1, 0.5, 0.5]), turn_deg, 0.0)
    assert found.exact_n_per_m == pytest.approx(limit_n_per_m, rel=5e-3)
    assert found.estimate_n_per_m == pytest.approx(found.exact_n_per_m, rel=0.012)
    assert found.passive_n_per_m == pytest.approx(8000.0)


@pytest.mark.parametrize("mass_kg", [0.1, 0.25, 1.0])
@pytest.mark.parametrize("damping", [1.0, 4.0])
def test_along_an_axis_it_is_the_limit_of_one_axis_in_closed_form(mass_kg: float, damping: float) -> None:
    """Jury's condition for m x'' + b x' + h x = -k x(n), by its own arithmetic: the determinant reaches 1."""
    device = loop([mass_kg] * 3, damping)
    limit = look(device, 0.0, 0.0).exact_n_per_m
    free, forced = device.held
    a, b = free[np.ix_([0, 3], [0, 3])], forced[[0, 3], 0]
    # det(A - b k [1 0]) = det A - k (b0 a11 - b1 a01)
    assert limit == pytest.approx((np.linalg.det(a) - 1.0) / (b[0] * a[1, 1] - b[1] * a[0, 1]), rel=1e-9)


@pytest.mark.parametrize("delay", [1, 2])
def test_a_delay_takes_off_the_limit_what_it_does_on_one_axis(delay: int) -> None:
    """About b / (T/2 + delay): within 3 % at m/b far over the period."""
    device = loop([0.5] * 3, 4.0, delay)
    assert look(device, 30.0, 20.0).exact_n_per_m == pytest.approx(4.0 / (1e-3 * (0.5 + delay)), rel=0.03)


def test_what_sticks_holds_no_more_than_the_weakest_way() -> None:
    device = loop([0.1, 0.25, 0.5])
    weakest = min(look(device, turn, tilt).exact_n_per_m for turn in range(0, 180, 30) for tilt in range(-90, 91, 30))
    assert device.limit_n_per_m(np.eye(3)) <= weakest * (1.0 + 1e-9)


def test_a_ball_pushes_off_and_a_cavity_back_in() -> None:
    z = np.array([0.0, 0.0, 1.0])
    along = np.eye(3)[:2]
    ball = surface_stiffness(z, along, (50.0, 50.0), 1e-3)
    assert np.diag(ball) == pytest.approx([-0.05 / 0.95, -0.05 / 0.95, 1.0])
    assert np.diag(surface_stiffness(z, along, (-50.0, 0.0), 1e-3)) == pytest.approx([0.05 / 1.05, 0.0, 1.0])


def agreement(places: int, seed: int) -> None:
    stable = 0
    for at in range(places):
        pressed = draw(np.random.default_rng((seed, at)), KINDS[at % len(KINDS)])
        expected = pressed.loop.radius(pressed.stiffness_n_per_m * pressed.shape) < 1.0
        stable += expected
        assert settles(pressed, at) is expected, (at, pressed.kind)
    assert 0.2 * places < stable < 0.8 * places  # both verdicts are there to be missed


def test_stepping_the_proxy_says_what_the_eigenvalues_say() -> None:
    agreement(36, 5)


@pytest.mark.nightly
def test_stepping_says_what_the_eigenvalues_say_in_a_thousand_places() -> None:
    agreement(1000, 1)


def test_the_command_writes_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["study", "space", "--places", "0", "--mass", "0.2,0.2,0.4", "--output", str(tmp_path), "--json"])
    assert not end.value.code
    found = json.loads(capsys.readouterr().out)
    assert found == json.loads((tmp_path / "space.json").read_text())
    assert found["weakest"]["exact_n_per_m"] <= found["strongest"]["exact_n_per_m"]
    lines = (tmp_path / "space.csv").read_text().splitlines()
    assert len(lines) == 1 + len(found["directions"])
    assert (tmp_path / "space.png").read_bytes().startswith(b"\x89PNG")


def test_the_linkage_weighs_at_a_place_what_the_simulated_device_weighs_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At the end of its reach the arms are long levers: one direction is more than twice as heavy as another."""
    place = ["--mass", "0.25", "--linkage", "0.08,0,0.06"]
    with pytest.raises(SystemExit) as end:
        main(["study", "space", "--places", "0", *place, "--output", str(tmp_path), "--json"])
    assert not end.value.code
    found = json.loads(capsys.readouterr().out)
    assert found["mass_kg"] == mass_matrix(0.25, (0.0, 0.0, 0.0), 0.08, 0.0, 0.06)
    lightest, _, heaviest = np.linalg.eigvalsh(found["mass_kg"])
    assert heaviest > 2.4 * lightest
    assert found["strongest"]["exact_n_per_m"] > 1.1 * found["weakest"]["exact_n_per_m"]


@pytest.mark.parametrize("place", ["0,0", "0,0,0.07", "nan,0,0", "a,b,c"])
def test_a_place_that_no_arm_reaches_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["study", "space", "--mass", "0.25", "--linkage", place, "--output", str(tmp_path)])
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith(f"hapticd: --linkage {place}")


@pytest.mark.parametrize(
    ("option", "value"), [("--mass", "1,2"), ("--mass", "0"), ("--damping", "4,4,x"), ("--mass", "1,2,3,0,1,0,0,0,1")]
)
def test_a_matrix_that_is_none_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["study", "space", option, value, "--output", str(tmp_path)])
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith(f"hapticd: {option} {value}: must be ")
