"""Runs of late clients as machine code are those of the daemon's own tick, and windows say what they hold."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from hapticd.errors import PluginError
from hapticd.offline.outcome import Outcome
from hapticd_studies.law_spec import LawSpec, parse_laws
from hapticd_studies.remote.compiled import CompiledCase
from hapticd_studies.remote.network import Network
from hapticd_studies.remote.report import report
from hapticd_studies.remote.runs import COLUMNS, Case, draw, run
from hapticd_studies.remote.sweep import RemotePlan
from hapticd_studies.remote.windows import lost_table, windows_table


def damper(n_s_per_m: int) -> LawSpec:
    return LawSpec(f"damper:damping_n_s_per_m={n_s_per_m}", "damper", {"damping_n_s_per_m": n_s_per_m})


# Not by parse_laws, which compiles each: every worker reads this file.
NONE, TDPA, RING, CYCLE, LATE = (
    LawSpec(name, name, {}) for name in ("none", "tdpa", "ring-damping", "energy-cycle", "late-cycle")
)
DAMPER = damper(50)
PAUSED = replace(draw(4, 1, "tool"), network=Network(90.0, 0.02, 0.005, 0.3, 4.0, 1.0, 0.9))


@pytest.mark.parametrize(
    ("case", "law"),
    [
        (PAUSED, LATE),
        (replace(PAUSED, kind="force"), LATE),
        (draw(4, 45, "tool"), LATE),  # thrown about, at its limits
        (draw(4, 3, "force", "stroke"), LATE),
        (draw(4, 2, "tool", "tap"), LATE),
        (replace(PAUSED, come_in_s=0.0), LATE),
        *[
            pytest.param(draw(5, index, kind, hand), law, marks=pytest.mark.nightly)
            for index in range(10)
            for kind in ("tool", "force")
            for hand in ("press", "stroke", "tap")
            for law in (NONE, TDPA, RING, CYCLE, LATE, damper(600))
        ],
    ],
)
def test_a_compiled_run_is_the_run_of_the_daemons_own_tick_to_the_last_bit(case: Case, law: LawSpec) -> None:
    path_m: list[float] = []
    ticked = run(case, law, lambda rehearsal: path_m.append(rehearsal.model.x_m))
    ready = CompiledCase(case)
    assert ready.path(law)[0].tolist() == path_m
    assert ready.run(law) == ticked


def test_a_coupling_that_comes_in_slowly_does_not_throw_off_the_body_that_a_prompt_one_does() -> None:
    prompt, slow = (
        CompiledCase(case).run(LATE) for case in (draw(7, 374, "tool", come_in_s=0.0), draw(7, 374, "tool"))
    )
    assert prompt[1] > 1e-3
    assert slow[0] == Outcome.SETTLED


def test_a_law_that_cannot_be_compiled_is_refused_by_name() -> None:
    with pytest.raises(PluginError, match="looping_law"):
        CompiledCase(PAUSED).run(LawSpec("looping", "tests.studies.looping_law", {}))


def rows(plan: RemotePlan, held: dict[tuple[str, str], set[str]], span_m: float) -> list[dict[str, float]]:
    """What became of each run of a plan where these laws hold these clients, and the others move by so much."""
    found = []
    for case, law in plan.cells:
        settled = law.label in held.get((case.kind, case.name), set())
        row = dict.fromkeys(COLUMNS, 0.0)
        found.append(row if settled else row | {"outcome": float(Outcome.MOVING), "span_m": span_m})
    return found


def test_a_window_counts_what_some_damper_holds_and_tells_what_the_law_does_not() -> None:
    window = parse_laws("none," + ",".join(f"damper:damping_n_s_per_m={value}" for value in (2, 20, 200, 600)), {})
    plan = RemotePlan(1, 4, [NONE, LATE], [DAMPER], window, False)
    labels = [law.label for law in window]
    held = {
        ("tool", "1:0"): {LATE.label, *labels},
        ("tool", "1:1"): {*labels[1:4]},
        ("tool", "1:2"): {labels[3]},
        ("tool", "1:3"): {DAMPER.label},  # in no window
        ("force", "1:0"): {*labels[2:]},
    }
    for span_m, within in ((1e-4, 1), (1e-3, 0)):
        found = report(plan, rows(plan, held, span_m))
        tool, force = (one for one in found.windows if one.law == LATE.label)
        counts = (tool.held_by_dampers, tool.wide, tool.not_held, tool.wide_not_held, tool.wide_within)
        assert counts == (3, 2, 2, 1, within)
        assert (force.held_by_dampers, force.wide, force.not_held, force.wide_within) == (1, 1, 1, within)
    assert [(one.client, one.lowest_n_s_per_m, one.highest_n_s_per_m, one.dampers) for one in found.lost] == [
        ("tool:1:1", 2.0, 200.0, 3),
        ("tool:1:2", 200.0, 200.0, 1),
        ("force:1:0", 20.0, 600.0, 3),
    ]
    assert json.loads(found.json())["lost"][1]["dampers"] == 1
    assert [table.row_count for table in (windows_table(found.windows), lost_table(found.lost))] == [4, 3]


@pytest.mark.nightly
def test_of_two_couplings_as_stiff_and_as_late_one_needs_from_the_beginning_what_the_other_does_not_bear() -> None:
    """Of 6 kN/m and 20 ms: 60 N s/m within the first tenth of a second, and no more than 30."""
    needs, bears = (CompiledCase(draw(*each, "tool", come_in_s=0.0)) for each in ((102, 263), (103, 25)))
    values = (2, 5, 10, 20, 30, 60, 80, 120, 180, 270, 400)

    def held(case: CompiledCase, first: float, at_s: float) -> set[int]:
        laws = (
            LawSpec(
                "changing",
                "tests.studies.changing_damper",
                {"first_n_s_per_m": first, "later_n_s_per_m": float(later), "at_s": at_s},
            )
            for later in values
        )
        return {value for value, law in zip(values, laws, strict=True) if case.run(law)[0] == Outcome.SETTLED}

    assert held(needs, 0.0, 0.0) == {60, 80, 120, 180, 270, 400}
    assert held(needs, 20.0, 0.1) == set(), "thrown about, it is not brought down"
    assert held(bears, 0.0, 0.0) == {2, 5, 10, 20, 30}
    assert held(bears, 100.0, 1.0) == set(), "left to swing for a second"
