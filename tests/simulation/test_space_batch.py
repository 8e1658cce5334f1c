"""A run in space is the daemon's to the last bit when it is compiled: every tick, and every object that it leaves."""

from __future__ import annotations

import pytest

from hapticd.config.loading import load, parse
from hapticd.offline.rehearsal import ticks_in
from hapticd.offline.track import track
from hapticd.paths import directory
from hapticd_studies.law_spec import LawSpec, parse_laws
from hapticd_studies.space_robustness.cases import draw
from hapticd_studies.space_robustness.surfaces import KINDS
from tests.simulation.both_in_space import Both

TICKS = 400
FEW = [12 * at for at in range(len(KINDS))]
"""Of the random cases one a surface; hands, friction and the kind of device come as they come."""

NOT_COMPILED = {
    "scene.walls": "[[scene.walls]]\naxis = 'x'\nposition_m = -0.2\nstiffness_n_per_m = 1e3\n",
    "scene.couplings": "[[scene.couplings]]\nname = 'tool'\nstiffness_n_per_m = 500.0\nmax_force_n = 3.0\n",
    "difference of two samples": "[velocity]\nsamples = 3\n",
    "safety.max_speed_m_per_s": "[safety]\nmax_speed_m_per_s = 1.0\n",
}


def law(name: str) -> LawSpec:
    return parse_laws(name, {})[0]


def differences(spec: LawSpec, cases: list[int], ticks: int) -> list[str]:
    """What of some cases is not the same both ways."""
    found, touched = [], 0
    for index in cases:
        case = draw(5, index)
        both = Both(case.loaded(spec), ticks)
        assert both.whole, case.name
        touched += both.touched > ticks // 10
        parted = [at for at, rows in enumerate(zip(both.rows, both.trace, strict=True)) if rows[0] != rows[1]]
        found += [f"{case.name} from tick {at} on" for at in parted[:1]]
        found += [f"{case.name} {each}" for each in both.apart[:5]]
    assert touched > len(cases) // 2
    return found


def test_compiled_runs_over_surfaces_hands_friction_and_devices_are_the_daemon_s() -> None:
    cases = [draw(5, index) for index in FEW]
    assert {case.rough for case in cases} == {True, False}
    assert len({case.hand for case in cases}) == 5
    assert {frozenset(case.options["space"]) & {"mass_kg", "mass_matrix_kg", "linkage"} for case in cases} == {
        frozenset([kind]) for kind in ("mass_kg", "mass_matrix_kg", "linkage")
    }
    assert differences(law("energy-cycle"), FEW, TICKS) == []


@pytest.mark.nightly
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["none", "damper", "tdpa", "ring-damping", "energy-cycle"])
def test_under_every_law_they_are(name: str) -> None:
    assert differences(law(name), list(range(3, 300, 7)), 1500) == []


@pytest.mark.parametrize("named", NOT_COMPILED)
def test_what_cannot_be_compiled_is_named_and_runs_interpreted(named: str) -> None:
    text = (directory("config") / "ball.toml").read_text()
    ran = track(parse(f"{text}\n{NOT_COMPILED[named]}", "lab.toml"), 20)
    assert named in ran.interpreted
    assert len(ran.trace) == 20


def test_a_mesh_runs_interpreted() -> None:
    ran = track(load(directory("config") / "mesh.toml"), 20)
    assert ran.interpreted == 'shape = "mesh"'
    assert len(ran.trace) == 20


@pytest.mark.nightly
def test_a_run_that_leaves_all_bounds_ends_as_it_does_interpreted() -> None:
    """A device that its own friction drives flies off; the daemon says so, and so does a run begun compiled."""
    text = (
        (directory("config") / "ball.toml")
        .read_text()
        .replace('model = "omega7"', 'model = "omega7"\nviscous_n_s_per_m = -60.0')
    )
    loaded = parse(text, "lab.toml")
    ticks = ticks_in(loaded, 0.3)
    ran, plain = track(loaded, ticks), track(loaded, ticks, compiled=False)
    assert ran.fault == plain.fault
    assert ran.interpreted == "the run leaves all bounds"
    assert ran.trace.tolist() == plain.trace.tolist()
