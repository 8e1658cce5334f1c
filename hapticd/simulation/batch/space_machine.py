"""What is compiled of the daemon's tick in space, and the machine code of a run under one law."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from hapticd.law import LawSnapshot, LawTick, state_fields
from hapticd.shapes.proxy import follow, place
from hapticd.shapes.reach import Nearby, slack_m
from hapticd.shapes.solid import Part, Proxy
from hapticd.simulation.batch.space_kernel import SpaceLoop, run
from hapticd.simulation.compiler.classes import Form, Machine, as_tuple
from hapticd.simulation.compiler.compile import OPTIONS, param_kinds, refuse
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.plant import PlantParams, PlantState, move, sense
from hapticd.simulation.space.coupled import place_of, swing
from hapticd.tick.contact import RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.guard import Guard
from hapticd.tick.space.channel import Channel, Direction
from hapticd.tick.space.crease import grip
from hapticd.tick.space.solid import Solid
from hapticd.tick.space.solid_contact import SolidContact
from hapticd.tick.velocity import Difference

_USUAL = dict.fromkeys(
    (
        *("COUPLED", "DELAY", "SATURATION", "SPRING", "FRICTION", "QUANTISED"),
        *("HAND", "TIMED", "HAND_STEP", "HAND_RAMP", "HAND_SINE", "HAND_PRESS"),
    ),
    True,
)
"""Terms that are compiled in any case: most devices have some of them, and each further set is compiled anew."""


@cache
def without_law() -> Machine:
    """What no law has a part in, compiled once for all of them."""
    machine = Machine(
        {
            Proxy: Form(),
            Part: Form(),
            Solid: Form(("stored_j",)),
            EnergyLedger: Form(("update",), ("debt_j",)),
            Direction: Form(),
            LawTick: Form(),
            Nearby: Form(("moved_out", "stay"), without=("_proxies",)),
            Difference: Form(),
            SpaceLoop: Form(),
            PlantState: Form(),
            PlantParams: Form(),
            Guard: Form(
                ("reduce",),
                instead={"self.changing": "False", "self.mode is not _ARMED": "False", "self.drop()": "self.latched"},
            ),
        },
        {},
    )
    for function in (follow, place, slack_m, place_of, swing):
        machine.compiled(function)
    return machine


class SpaceMachine:
    """The classes of the tick under one law, and the machine code of a run.

    Args:
        law: one that a contact has.

    Attributes:
        classes: of all objects of a run.

    Raises:
        PluginError: the law cannot be compiled.
    """

    def __init__(self, law: RunningLaw) -> None:
        module = law.module
        refuse(module)
        self._run: Any = None
        self._terms = dict(_USUAL)
        published = {name: str(getattr(law, name)) for name in ("publishes", "publishes_damping", "publishes_mass")}
        self.classes = Machine(
            {
                SolidContact: Form(
                    (
                        *("start", "observe", "act", "add", "settle"),
                        *("_rest", "_lose", "_stand", "_face"),
                    ),
                    instead={
                        "self.normal": "self.channels[0]",
                        "proxy.voxels": "NO_VOXELS",
                        "channel.snapshot()": "channel.snapshot(0.0)",
                    },
                    without=("normal",),
                ),
                Channel: Form(
                    ("rest", "see", "apply", "act", "ask", "snapshot"),
                    instead={f"law.{name}": value for name, value in published.items()},
                    without=("ledger",),
                ),
                RunningLaw: Form(given={"step": _step, "start": _start}),
                type(law.state): Form(kinds=state_fields(module)),
                type(law.params): Form(kinds=param_kinds(module)),
            },
            {
                "NO_VOXELS": np.zeros(1),
                "LawSnapshot": as_tuple(LawSnapshot),
                "law_step": module.step,
                "law_start": module.start,
                "_number": _number,
            },
            (Channel.__module__, grip.__module__, run.__module__),
            without_law(),
        )

    def run(self, needed: Mapping[str, bool]) -> Any:
        """`space_kernel.run` for devices that need these terms; one that can do more gives the same numbers."""
        missing = any(on and not self._terms.get(name, False) for name, on in needed.items())
        if self._run is None or missing:
            self._terms = {name: on or self._terms.get(name, False) for name, on in needed.items()}
            plant = {"move": specialise(move, self._terms), "sense": specialise(sense, self._terms)}
            self._run = Machine({}, plant, on=self.classes).compiled(run, OPTIONS)
        return self._run


def law_step(state: Any, params: Any, tick: Any) -> float:
    """Stands for the law."""
    raise NotImplementedError


def law_start(state: Any, params: Any, snapshot: Any) -> None:
    """Stands for the law."""
    raise NotImplementedError


def _step(_law: Any, state: Any, params: Any, tick: Any) -> float:
    return law_step(state, params, tick)


def _start(law: Any, snapshot: Any) -> None:
    law_start(law.state, law.params, snapshot)


def _number(_value: float) -> float:
    """Of a law that is beyond all bounds; the daemon would replace it."""
    raise ArithmeticError("beyond all bounds")


_MACHINES: dict[ModuleType, SpaceMachine] = {}


def machine_of(law: RunningLaw) -> SpaceMachine:
    """The one of a law, made once.

    Raises:
        PluginError: the law cannot be compiled.
    """
    if law.module not in _MACHINES:
        _MACHINES[law.module] = SpaceMachine(law)
    return _MACHINES[law.module]
