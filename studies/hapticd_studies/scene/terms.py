"""The terms of a scene, each as an edit of the file that takes it out and keeps everything else, comments too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import tomlkit

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.model_choice import omissions
from hapticd.offline.rehearsal import simulation_options

Document = Any  # tomlkit's documents and tables, which are dictionaries with a memory for comments
Edit = Callable[[Document], None]


@dataclass(frozen=True, slots=True)
class Term:
    """Something that a scene has and might do without.

    Attributes:
        name: for people.
        edit: takes it out of a document.
        order: edits are made in this order, so that counting walls stays right.
    """

    name: str
    edit: Edit
    order: int = 0


def terms_of(loaded: LoadedConfig) -> list[Term]:
    """Everything that a configuration has and might do without, the law excepted."""
    options = simulation_options(loaded)
    found = [Term(one.name, _device_edit(one.key, one.change_key)) for one in omissions(options)]
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
    document = tomlkit.parse(loaded.text)
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
            yield Term(f"changes{of}", _wall_without_changes(index))
    for index in range(len(walls) - 1, 0, -1):  # from the end, so that the others keep their numbers
        yield Term(f"wall {index}", _without_wall(index), order=1 + len(walls) - index)


def _device_edit(key: str, change_key: str) -> Edit:
    *tables, last = key.split(".")

    def edit(document: Document) -> None:
        _without_change(_table(document, "device", "options"), change_key)
        table = _table(document, "device", "options", *tables)
        if tables:
            table.pop(last, None)  # a hand has nothing that is not given
        else:
            table[last] = 0 if last == "force_delay_samples" else 0.0  # a preset may have it
            _drop_zero(document, table, last)

    return edit


def _drop_zero(document: Document, table: Document, key: str) -> None:
    """Leave a zero out where the file means the same without it."""
    options = parse(tomlkit.dumps(document), "-").options
    value = table.pop(key)
    try:
        same = parse(tomlkit.dumps(document), "-").options == options
    except ValueError:
        same = False
    if not same:
        table[key] = value


def _without_change(table: Document, *keys: str) -> None:
    """Take keys out of every entry of `changes`, and entries that change nothing any more."""
    if "changes" not in table:
        return
    kept = []
    for change in table["changes"]:
        left = {name: value for name, value in change.items() if name not in keys}
        if len(left) > 1:
            kept.append(left)
    if not kept:
        table.pop("changes")
    elif len(kept) < len(table["changes"]) or any(
        dict(old) != new for old, new in zip(table["changes"], kept, strict=True)
    ):
        array = tomlkit.array()
        for left in kept:
            entry = tomlkit.inline_table()
            entry.update(left)
            array.append(entry)
        table["changes"] = array


def _without_keys(path: Sequence[str], *keys: str) -> Edit:
    def edit(document: Document) -> None:
        table = _table(document, *path)
        for key in keys:
            table.pop(key, None)

    return edit


def _without_filter(document: Document) -> None:
    document.pop("velocity", None)


def _wall_without_damping(index: int) -> Edit:
    def edit(document: Document) -> None:
        wall = document["scene"]["walls"][index]
        wall.pop("damping_n_s_per_m", None)
        _without_change(wall, "damping_n_s_per_m")

    return edit


def _wall_without_changes(index: int) -> Edit:
    def edit(document: Document) -> None:
        document["scene"]["walls"][index].pop("changes", None)

    return edit


def _without_wall(index: int) -> Edit:
    def edit(document: Document) -> None:
        del document["scene"]["walls"][index]

    return edit


def _table(document: Document, *path: str) -> Document:
    for name in path:
        if name not in document:
            document[name] = tomlkit.table()
        document = document[name]
    return document
