"""What can be chosen in the model of a device: integrators with their sub-steps, precision, terms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

from hapticd.offline.model_choice import OMISSIONS, omissions
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.accuracy.devices import AdaptiveDevice, SingleDevice

MakeDevice = Callable[[SimulationOptions, float], SimulatedDevice]

SUBSTEPS = {
    "explicit-euler": (1, 2, 4, 16, 64),
    "semi-implicit-euler": (1, 2, 4, 16, 64),
    "velocity-verlet": (1, 2, 4, 16),
    "rk4": (1, 2, 4),
}
ADAPTIVE: tuple[tuple[Literal["DOP853", "Radau"], float], ...] = (
    ("DOP853", 1e-6),
    ("DOP853", 1e-9),
    ("DOP853", 1e-12),
    ("Radau", 1e-6),
    ("Radau", 1e-9),
)


@dataclass(frozen=True)
class Setting:
    """One way to compute a device.

    Attributes:
        name: for people and files.
        family: what it belongs to in a picture.
        options: of the device.
        make_device: makes the device model.
        offered: may be chosen; what the device declares to controllers is not left out for them.
        counted: done by the interpreter alone, so that its instructions say what it costs.
    """

    name: str
    family: str
    options: SimulationOptions
    make_device: MakeDevice = SimulatedDevice
    offered: bool = True
    counted: bool = True


def settings_of(options: SimulationOptions) -> Iterator[Setting]:
    """Everything that can be chosen for a device; the first one is the exact step of the full model."""
    full = options.model_copy(update={"integrator": "exact", "substeps": 1, "accuracy": None})
    yield Setting("exact", "exact", full)
    for integrator, counts in SUBSTEPS.items():
        for count in counts:
            changed = full.model_copy(update={"integrator": integrator, "substeps": count})
            yield Setting(f"{integrator} x{count}", integrator, changed)
    for method, relative in ADAPTIVE:
        make = partial(AdaptiveDevice, method=method, relative=relative)
        yield Setting(f"{method} {relative:.0e} with events", "adaptive", full, make, counted=False)
    yield Setting("exact, float32", "float32", full, SingleDevice, counted=False)
    for term in omissions(full):
        yield Setting(f"without {term.name}", "without a term", term.apply(full), offered=not term.declared)
    for term in OMISSIONS:
        if not term.present(full):
            yield Setting(f"with {term.name}, {term.usual:g}", "with one more term", term.add(full), offered=False)


def default_name(options: SimulationOptions) -> str:
    """Name of the setting that a configuration has."""
    return "exact" if options.integrator == "exact" else f"{options.integrator} x{options.substeps}"
