"""Each claim of `hapticd study paper` can come out either way: other runs, judged alike, make the other verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from hapticd_studies.paper import starts
from hapticd_studies.paper.claims import HELD, OFF_COUNT, Evidence
from hapticd_studies.paper.judge import judge
from hapticd_studies.paper.recording import record
from hapticd_studies.paper.runs import Asked, Runs
from hapticd_studies.paper.scenarios import LITERAL, SCENARIOS
from hapticd_studies.paper.starts import (
    BEYOND_N_PER_M,
    HANDS_N,
    HELD_N_PER_M,
    NATIVE_N_PER_M,
    NOISES_M,
    WINDOW_DEVICES,
    WINDOW_HANDS_N,
    WINDOW_READINGS,
    WINDOWS,
    WINDOWS_N_PER_M,
)
from tests.studies.paper_evidence import evidence

HOLD = {
    "loop",
    "leak",
    "fig6-set1",
    "fig6-release",
    "fig6-set2",
    "bounded-generation",
    "no-parameter",
    "false-cycles",
    "window-larger",
    "unstable-alone",
    "held",
    "gain",
    "energy-below-zero",
    "displayed-stiffness",
    "tdpa-unstable",
    "tdpa-unstable-printed",
    "tdpa-cuts-force",
    "low-velocity",
    "no-credit",
}
DO_NOT_HOLD = {
    "observer",
    "alpha-max",
    "bounded-generation-quantised",
    "window-needed",
    "window-needed-spring",
    "window-needed-literal",
    "window-needed-letter",
    "native-limit",
    "displayed-stiffness-unsmoothed",
    "tdpa-bounded",
    "tdpa-energy",
    "moving-hand",
    "low-frequency",
    "chattering",
}

Other = Callable[[Evidence], Evidence]


def verdict(evidence: Evidence, key: str) -> bool:
    (found,) = [claim for claim in judge(evidence) if claim.key == key]
    return found.holds


def ran(changes: dict[str, dict[str, Any]], duration_s: float | None = None) -> Other:
    """These scenarios run again with other keys, in place of the study's."""

    def other(evidence: Evidence) -> Evidence:
        runs = {name: record(replace(SCENARIOS[name], **keys), duration_s) for name, keys in changes.items()}
        figures = {name: run.figures() for name, run in runs.items()}
        return replace(evidence, runs={**evidence.runs, **runs}, figures={**evidence.figures, **figures})

    return other


def instead(changes: dict[str, str]) -> Other:
    """Runs of the study in place of others."""

    def other(evidence: Evidence) -> Evidence:
        runs = {name: evidence.runs[source] for name, source in changes.items()}
        figures = {name: evidence.figures[source] for name, source in changes.items()}
        return replace(evidence, runs={**evidence.runs, **runs}, figures={**evidence.figures, **figures})

    return other


def long(name: str, **keys: Any) -> Other:
    """A long run with other keys."""

    def other(evidence: Evidence) -> Evidence:
        names = [name] if name.endswith("continuous") else [held for held in evidence.long if "continuous" not in held]
        runs = {one: record(replace(SCENARIOS[one], **keys), 15.0) for one in names}
        return replace(evidence, long={**evidence.long, **runs})

    return other


def picked(asked: Asked, rows: Any) -> Asked:
    """Some runs of many, in another order."""
    rows = np.asarray(rows).ravel()
    columns = {one.name: getattr(asked, one.name)[rows] for one in fields(asked) if one.name != "points"}
    return Asked([asked.points[row] for row in rows], **columns)


def shares(**changes: Callable[[starts.Shares], Asked]) -> Other:
    """Other runs from many starts."""

    def other(evidence: Evidence) -> Evidence:
        asked = {name: change(evidence.shares) for name, change in changes.items()}
        return replace(evidence, shares=replace(evidence.shares, **asked))  # type: ignore[arg-type]  # names as given

    return other


def alone(count: int) -> Callable[[starts.Shares], Asked]:
    """12 kN/m without a law, on every one of so many walls."""

    def of(shares: starts.Shares) -> Asked:
        rows = np.arange(len(shares.native.points)).reshape(len(NATIVE_N_PER_M), -1)
        return picked(shares.native, np.tile(rows[NATIVE_N_PER_M.index(12e3)], count))

    return of


def finer(shares: starts.Shares) -> Asked:
    """No law on a device with finer steps and a little more friction."""
    runs = Runs()
    asked = starts.native(runs, shares.drops_m, resolution_m=2e-6, viscous_n_s_per_m=4.5)
    runs.run(starts.DURATION_S, lambda _: None)
    return asked


def with_the_window_as_shipped(shares: starts.Shares) -> Asked:
    """Without the window the runs of the literal reading, with it those of the shipped one, whatever the reading."""
    names = list(WINDOW_READINGS)
    shape = (len(WINDOW_DEVICES), len(names), len(NOISES_M), 2, len(WINDOW_HANDS_N), len(shares.window_drops_m))
    rows = np.arange(len(shares.window.points)).reshape(shape).copy()
    literal, shipped = rows[:, names.index("literal"), :, 0].copy(), rows[:, names.index("shipped"), :, 1].copy()
    rows[:, :, :, 0], rows[:, :, :, 1] = literal[:, None], shipped[:, None]
    return picked(shares.window, rows)


def always_two(shares: starts.Shares) -> Asked:
    """The smallest window in place of every larger one."""
    rows = np.arange(len(shares.windows.points)).reshape(len(WINDOWS_N_PER_M), len(WINDOWS), -1)
    return picked(shares.windows, np.repeat(rows[:, :1], len(WINDOWS), axis=1))


def held_under_3_newton(shares: starts.Shares) -> Asked:
    """Energy cycles in place of TDPA."""
    rows = np.arange(len(shares.held.points)).reshape(len(HELD_N_PER_M), len(HANDS_N), -1)
    return picked(shares.held, rows[:, HANDS_N.index(-3.0)])


def alone_under_3_newton(shares: starts.Shares) -> Asked:
    """No law at 12 kN/m in place of TDPA."""
    rows = np.arange(len(shares.native.points)).reshape(len(NATIVE_N_PER_M), len(HANDS_N), -1)
    at_12 = rows[NATIVE_N_PER_M.index(12e3), HANDS_N.index(-3.0)]
    return picked(shares.native, np.tile(at_12, len(HELD_N_PER_M)))


def models_alone(shares: starts.Shares) -> Asked:
    return shares.models_alone


_FREE = {"law": "none", "params": {}}
_CONTINUOUS = {"device": {"resolution_m": 0.0}}
_EVERY = (*HELD, *OFF_COUNT)
_WIDE = {"device": {"viscous_n_s_per_m": 20.0}}
_GENTLE = {"law": "damper", "params": {"damping_n_s_per_m": 1.5}}

OTHERS: dict[str, Other] = {
    # Dissipating more than the hold gives, the loop runs the other way round.
    "loop": ran({"fig1": {"wall": {"stiffness_n_per_m": 3e3, "damping_n_s_per_m": 5.0}}}),
    # What a negative damping of the wall generates, even the printed observer sees.
    "observer": ran({"fig3": {"wall": {"stiffness_n_per_m": 3e3, "damping_n_s_per_m": -30.0}}}, 0.5),
    "leak": ran({"fig3": {"wall": {"stiffness_n_per_m": 3e3, "damping_n_s_per_m": 3.0}}}),
    "fig6-set1": ran({"fig6-set1": _FREE}),
    # It starts as the shipped law does; what its damping loses again, the later cycles give.
    "fig6-release": ran({"fig6-set1": {"params": {"rule": "signed"}}}),
    "fig6-set2": ran({"fig6-set2-wall": {"params": LITERAL}}),
    # kT/2 as a constant damper, with as much friction in the device that it comes to rest.
    "alpha-max": ran(
        {
            name: {
                "law": "damper",
                "params": {"damping_n_s_per_m": 0.5e-3 * SCENARIOS[name].stiffness_n_per_m},
                "device": {**SCENARIOS[name].device, "viscous_n_s_per_m": 4.4},
            }
            for name in ("fig6-set1", "fig6-set1-drop", "fig9-18-continuous", "fig9-20-continuous")
        }
    ),
    "bounded-generation": long("fig9-18-continuous", **_FREE),
    "bounded-generation-quantised": long("fig9-18", **_CONTINUOUS),
    "no-parameter": shares(models=models_alone),
    "false-cycles": ran({"fig7": _CONTINUOUS}),
    "window-needed": shares(window=with_the_window_as_shipped),
    "window-needed-spring": shares(window=with_the_window_as_shipped),
    "window-needed-literal": shares(window=with_the_window_as_shipped),
    "window-needed-letter": shares(window=with_the_window_as_shipped),
    "window-larger": shares(windows=always_two),
    "native-limit": shares(native=finer),
    "unstable-alone": instead({"fig8": "fig9-12"}),
    "held": shares(held=alone(len(HELD_N_PER_M))),
    "gain": shares(beyond=alone(len(BEYOND_N_PER_M)), held=alone(len(HELD_N_PER_M))),
    "energy-below-zero": instead({"fig9-18": "fig8"}),
    # An oscillation has the wall's stiffness over any half second, but not over 20 ms.
    "displayed-stiffness": instead({"fig9-12": "fig8"}),
    "displayed-stiffness-unsmoothed": ran(dict.fromkeys(_EVERY, _CONTINUOUS)),
    "tdpa-unstable": shares(tdpa=held_under_3_newton),
    "tdpa-unstable-printed": shares(tdpa_printed=held_under_3_newton),
    "tdpa-bounded": shares(tdpa_bounded=alone_under_3_newton),
    "tdpa-energy": ran(dict.fromkeys(("fig10", "fig10-printed"), _WIDE)),
    "tdpa-cuts-force": instead({"moving-12-tdpa": "moving-4-none"}),
    "low-velocity": instead({"fig10": "fig10-bounded"}),
    "moving-hand": instead(dict.fromkeys(("moving-4", "moving-12", "moving-20"), "moving-4-none")),
    "low-frequency": ran(dict.fromkeys(_EVERY, _CONTINUOUS)),
    "chattering": ran(dict.fromkeys(HELD, _CONTINUOUS)),
    # A stretch in which the wall generates drives the damping up before the comparison begins.
    "no-credit": ran(
        {
            "credit": {
                "wall": {
                    "stiffness_n_per_m": 12e3,
                    "damping_n_s_per_m": 30.0,
                    "changes": [{"at_s": 1.0, "damping_n_s_per_m": 0.0}],
                }
            }
        }
    ),
}
"""To each claim other runs, judged alike, that come out otherwise."""


@pytest.mark.parametrize("key", sorted(OTHERS))
def test_other_runs_make_the_other_verdict(key: str) -> None:
    study = evidence()
    assert verdict(OTHERS[key](study), key) is not verdict(study, key)


def test_every_claim_has_runs_that_make_the_other_verdict() -> None:
    assert sorted(claim.key for claim in judge(evidence())) == sorted(OTHERS)


def test_the_claims_that_reproduce_and_those_that_do_not() -> None:
    verdicts = {claim.key: claim.holds for claim in judge(evidence())}
    assert {key for key, holds in verdicts.items() if holds} == HOLD
    assert {key for key, holds in verdicts.items() if not holds} == DO_NOT_HOLD
