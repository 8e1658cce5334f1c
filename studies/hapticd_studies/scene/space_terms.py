"""The terms of a scene in space: axes, their coupling, objects, friction, and what the device has along each axis."""

from __future__ import annotations

from collections.abc import Iterator

import tomlkit

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.model_choice import OMISSIONS
from hapticd.offline.rehearsal import simulation_options
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.space.axes import AXES, axis_options
from hapticd_studies.scene.edits import Document, Edit, Term, device_edit, table_in

CLAMPED_N = 1e6
"""Coulomb friction of an axis that is left out: it stays where it starts [N]."""

_OBJECTS_LAST, _AXES_LAST = 100, 1000


def space_terms(loaded: LoadedConfig) -> Iterator[Term]:
    """Everything that a configuration with several axes has and might do without, the law excepted."""
    options = simulation_options(loaded)
    along = axis_options(options)
    for one in OMISSIONS:
        if any(one.present(each) and not (one.key == "coulomb_n" and _stays(each)) for each in along):
            yield Term(one.name, _vector_edit(one.key, one.change_key))
    space = options.space
    if space.mass_matrix_kg is not None or space.linkage != "none":
        yield Term("coupling of the axes", _uncoupled)
    for axis in range(options.axes):
        if not _stays(along[axis]):
            yield Term(f"axis {AXES[axis]}", _clamped(axis), order=_AXES_LAST)
    objects = loaded.config.scene.objects
    for index, each in enumerate(objects):
        if each.static_friction > 0.0:
            yield Term(f"friction of {each.name}", _object_without(index, "static_friction", "dynamic_friction"))
        if each.damping_n_s_per_m > 0.0:
            yield Term(f"damping of {each.name}", _object_without(index, "damping_n_s_per_m"))
    if len(objects) > 1:
        for index in reversed(range(len(objects))):  # from the end, so that the others keep their numbers
            yield Term(f"object {objects[index].name}", _without_object(index), order=_OBJECTS_LAST - index)


def _stays(along: SimulationOptions) -> bool:
    """Whether an axis is left out already."""
    return along.coulomb_n >= CLAMPED_N


def _vector_edit(key: str, change_key: str) -> Edit:
    """Take a vector out, and what stands for all axes where there is none."""
    *tables, last = key.split(".")
    for_all = device_edit(key, change_key)

    def edit(document: Document) -> None:
        options = table_in(document, "device", "options")
        space = options.get("space", {})
        for name in tables:
            space = space.get(name, {})
        values = space.pop(last, None)
        if key == "coulomb_n" and values is not None and max(values) >= CLAMPED_N:
            space[last] = [value if value >= CLAMPED_N else 0.0 for value in values]
        if not tables or tables[0] in options:
            for_all(document)

    return edit


def _uncoupled(document: Document) -> None:
    """Each axis by itself, with the mass that it has along its own direction."""
    space = table_in(document, "device", "options", "space")
    space.pop("linkage", None)
    matrix = space.pop("mass_matrix_kg", None)
    if matrix is not None:
        space["mass_kg"] = [float(row[at]) for at, row in enumerate(matrix)]


def _clamped(axis: int) -> Edit:
    def edit(document: Document) -> None:
        options = parse(tomlkit.dumps(document), "-").options
        assert isinstance(options, SimulationOptions)
        held_n = [each.coulomb_n for each in axis_options(options)]
        held_n[axis] = CLAMPED_N
        table_in(document, "device", "options", "space")["coulomb_n"] = held_n

    return edit


def _object_without(index: int, *keys: str) -> Edit:
    def edit(document: Document) -> None:
        for key in keys:
            document["scene"]["objects"][index].pop(key, None)

    return edit


def _without_object(index: int) -> Edit:
    def edit(document: Document) -> None:
        del document["scene"]["objects"][index]

    return edit
