"""The terms of a scene, each as an edit of the file that takes it out and keeps everything else, comments too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import tomlkit

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.model_choice import omissions
from hapticd.offline.rehearsal import simulation_options
from hapticd_studies.scene.edits import Document, Edit, Term, device_edit, table_in, without_change
from hapticd_studies.scene.space_terms import space_terms


def terms_of(loaded: LoadedConfig) -> list[Term]:
    """Everything that a configuration has and might do without, the law excepted."""
    options = simulation_options(loaded)
    if options.axes > 1:
        found = list(space_terms(loaded))
    else:
        found = [Term(one.name, device_edit(one.key, one.change_key)) for one in omissions(options)]
    if options.integrator != "exact":
        found.append(
            Term("sub-steps of the integrator", _without_keys(("device", "options"), "integrator", "substeps"))
        )
    for name, key in (("force delay within a period", "force_delay_s"), ("flexible handle", "flexible")):
        if getattr(options, key):
            found.append(Term(name, _without_keys(("device", "options"), key)))
    if options.changes:
        found.append(Term("changes of the device", _without_keys(("device", "options"), "changes")))
    velocity = loaded.config.velocity
    if velocity.estimator != "difference" or velocity.samples != 1:
        found.append(Term("velocity filter", _without_filter))
    found += _wall_terms(loaded)
    return found


def reduced(loaded: LoadedConfig, terms: Sequence[Term]) -> LoadedConfig:
    """The configuration without some terms.

    Raises:
        ConfigError: it would not be one any more.
    """
    document = tomlkit.parse(loaded.text.removeprefix("\ufeff"))
    for term in sorted(terms, key=lambda one: one.order):
        term.edit(document)
    return parse(tomlkit.dumps(document), str(loaded.path))


def _wall_terms(loaded: LoadedConfig) -> Iterator[Term]:
    walls = loaded.config.scene.walls
    for index, wall in enumerate(walls):
        of = f" of wall {index}" if len(walls) > 1 else " of the wall"
        if wall.damping_n_s_per_m != 0.0 or any(change.damping_n_s_per_m for change in wall.changes):
            yield Term(f"damping{of}", _wall_without_damping(index))
        if wall.changes:
            yield Term(f"changes{of}", _wallwithout_changes(index))
    for index in range(len(walls) - 1, 0, -1):  # from the end, so that the others keep their numbers
        yield Term(f"wall {index}", _without_wall(index), order=1 + len(walls) - index)


def _without_keys(path: Sequence[str], *keys: str) -> Edit:
    def edit(document: Document) -> None:
        table = table_in(document, *path)
        for key in keys:
            table.pop(key, None)

    return edit


def _without_filter(document: Document) -> None:
    document.pop("velocity", None)


def _wall_without_damping(index: int) -> Edit:
    def edit(document: Document) -> None:
        wall = document["scene"]["walls"][index]
        wall.pop("damping_n_s_per_m", None)
        without_change(wall, "damping_n_s_per_m")

    return edit


def _wallwithout_changes(index: int) -> Edit:
    def edit(document: Document) -> None:
        document["scene"]["walls"][index].pop("changes", None)

    return edit


def _without_wall(index: int) -> Edit:
    def edit(document: Document) -> None:
        del document["scene"]["walls"][index]

    return edit
