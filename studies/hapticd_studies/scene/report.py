"""What a scene needs, as a table, JSON and a configuration ready to save."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from rich.table import Table

from hapticd.offline.outcome import Criterion
from hapticd.version import __version__
from hapticd_studies.grid.output import as_json
from hapticd_studies.scene.answers import Answers
from hapticd_studies.scene.study import Scene
from hapticd_studies.scene.ticks import TickCount

_ON_ONE_AXIS = ("settles", "force", "energy", "stiffness")
_IN_SPACE = ("force", "energy", "path", "felt")

_MOST = 10.0
"""Changes beyond this share are all the same to a reader."""


def table(scene: Scene) -> Table:
    """Each term by itself, then all that can go together."""
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    shown.add_column("without", no_wrap=True)
    in_space = scene.full.in_space
    for head in ("saves", *(_IN_SPACE if in_space else _ON_ONE_AXIS)):
        shown.add_column(head, justify="right", no_wrap=True)
    shown.add_column("needed", overflow="fold")
    full = scene.full
    shown.add_row(
        "nothing",
        f"of {scene.operations:.0f}",
        *([] if in_space else [_seconds(full.settled_s)]),
        f"{full.peak_force_n:.3g} N",
        f"{max(map(abs, full.energy_j)):.2g} J",
        *(["", ""] if in_space else [_number(full.displayed_stiffness_n_per_m)]),
        full.outcome.words,
    )
    for one in scene.removals:
        if one.answers is None:
            reason = "yes: there is no such configuration"
            if one.term in scene.left_out:
                reason = "once others are gone: not before is there such a configuration"
            shown.add_row(one.term.name, "", "", "", "", "", reason)
            continue
        now = {"verdict": f"verdict ({one.answers.verdict})"}
        needed = "no"
        if one.broken:
            alone = "not with the others gone; alone" if one.term in scene.left_out else "yes"
            needed = f"{alone}: {', '.join(now.get(name, name) for name in one.broken)}"
        elif one.term not in scene.left_out:
            needed = "once others are gone"
        shown.add_row(one.term.name, f"{one.saved:.0f}", *_cells(one.answers, in_space), needed)
    saved = scene.operations - scene.minimal_operations
    name = f"all {len(scene.left_out)} that can go"
    shown.add_row(
        name, f"{saved:.0f}", *_cells(scene.minimal_answers, in_space), scene.minimal_answers.verdict, style="bold"
    )
    return shown


def sentences(scene: Scene, ticks: Sequence[TickCount]) -> Iterator[str]:
    """What it comes to, a line each."""
    felt = "" if math.isnan(scene.full.felt_index) else f"felt {scene.full.felt_index:.2g} times the threshold, "
    yield f"The full model: {scene.full.outcome.words}, {felt}force chatter {scene.full.force_chatter_n:.3g} N."
    gone = ", ".join(term.name for term in scene.left_out)
    yield (
        f"Within {100.0 * scene.tolerance:g} % this scene needs {len(scene.removals) - len(scene.left_out)} of its "
        f"{len(scene.removals)} terms" + (f"; it does without {gone}." if gone else ".")
    )
    if not scene.proven:
        yield "Too many terms to try all combinations: no further one can go, but others together might be more."
    named = {one.name: one.operations for one in ticks}
    yield (
        f"A tick takes {scene.minimal_operations:.0f} instead of {scene.operations:.0f} instructions; an empty loop "
        f"{named['empty loop']}, each plain wall {named['two walls'] - named['one wall']} more."
    )


def minimal_text(scene: Scene) -> str:
    """The smallest model as a file: the configuration as it was, comments included, without what it does not need."""
    gone = ", ".join(term.name for term in scene.left_out) or "nothing"
    return (
        f"# {scene.loaded.path} without what its scene does not need within {100.0 * scene.tolerance:g} %: {gone}.\n"
        f"{scene.minimal.text.lstrip()}"
    )


def json(scene: Scene, ticks: Sequence[TickCount], duration_s: float) -> bytes:
    """Everything, for programs."""
    return as_json(
        {
            "study": "scene",
            "hapticd": __version__,
            "config": str(scene.loaded.path),
            "duration_s": duration_s,
            "tolerance": scene.tolerance,
            "criterion": Criterion().declared(),
            "full": {
                "verdict": scene.full.outcome.words,
                "felt_index": scene.full.felt_index,
                "force_chatter_n": scene.full.force_chatter_n,
                "settled_s": scene.full.settled_s,
                "peak_force_n": scene.full.peak_force_n,
                "displayed_stiffness_n_per_m": scene.full.displayed_stiffness_n_per_m,
                "operations": scene.operations,
            },
            "terms": [
                {
                    "name": one.term.name,
                    "saved_operations": one.saved,
                    "answers": asdict(one.answers) if one.answers else None,
                    "broken": list(one.broken),
                }
                for one in scene.removals
            ],
            "minimal": {
                "without": [term.name for term in scene.left_out],
                "answers": asdict(scene.minimal_answers),
                "operations": scene.minimal_operations,
                "proven": scene.proven,
                "config": minimal_text(scene),
            },
            "tried": scene.tried,
            "ticks": [asdict(one) for one in ticks],
        }
    )


def _cells(found: Answers, in_space: bool) -> list[str]:
    if in_space:
        return [_percent(found.force), _percent(found.energy), _percent(found.path), f"{found.felt:.2g}"]
    return [
        _seconds(found.settled_s),
        _percent(found.force),
        _percent(found.energy),
        _percent(found.stiffness),
    ]


def _seconds(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.3f} s"


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.0f} N/m"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if share < _MOST else f"> {100.0 * _MOST:.0f} %"
