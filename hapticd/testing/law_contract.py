"""What every law must do, whatever it computes: a test module subclasses `LawContract` and names its law."""

from __future__ import annotations

import math
import random
import struct
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, ClassVar, Literal

import pytest

from hapticd import plugins
from hapticd.law import (
    LawParams,
    LawSnapshot,
    LawTick,
    Scalar,
    fresh_state,
    plain_object,
    rests_outside,
    scalar_params,
    state_fields,
)
from hapticd.offline.rehearsal import rehearse
from hapticd.simulation.compiler.lint import lint_law
from hapticd.testing.law_scenario import pressed

SEEDS = range(4)
SEQUENCES = 24
"""How many hostile sequences a seed stands for."""

_LARGEST = {
    "x_m": 1e8,
    "moved_m": 1e8,
    "velocity_m_per_s": 1e6,
    **dict.fromkeys(("contact_n", "spring_n", "applied_n", "applied_contact_n"), 1e18),
}
"""What `LawTick` promises of its numbers."""

_SHOWN = ("damping_n_s_per_m", "felt_mass_kg")
"""What a law's state has published."""

_TAPPING = {"profile": "press-and-release", "newton": -4.0, "release_newton": 2.0, "period_s": 0.25}


class LawContract:
    """Subclass as `TestYourLaw(LawContract)` and name your law.

    Attributes:
        law: what a configuration calls it: an installed name or `package.module`.
        params: parameters to try, each a table as in [controller.params]; each choice of the law is tried beside the
            first of them.
    """

    law: ClassVar[str]
    params: ClassVar[Sequence[Mapping[str, Any]]] = ({},)

    @pytest.fixture
    def module(self) -> ModuleType:
        """The law, found as the daemon finds it."""
        return plugins.law(self.law)

    @pytest.fixture
    def tried(self, module: ModuleType) -> list[LawParams]:
        """Every set of parameters that is tried."""
        first = self.params[0]
        choices = [{**first, name: value} for name, values in _choices(module).items() for value in values]
        return [module.Params.model_validate(dict(table)) for table in (*self.params, *choices)]

    def test_it_says_what_it_is_in_its_first_line(self, module: ModuleType) -> None:
        """`hapticd controllers` lists it with that line."""
        assert (module.__doc__ or "").strip(), f"{module.__name__} has no docstring"

    def test_it_is_arithmetic_on_numbers(self, module: ModuleType) -> None:
        """Then it computes the same in the loop and as machine code."""
        findings = lint_law(module)
        assert not findings, "\n" + "\n".join(map(str, findings))

    def test_a_choice_is_the_constant_of_its_name(self, module: ModuleType) -> None:
        """`rule = "signed"` arrives as the index of the choice; a constant RULE_SIGNED must be that index."""
        for name, values in _choices(module).items():
            for index, value in enumerate(values):
                constant = f"{name}_{value}".upper().replace("-", "_")
                assert getattr(module, constant, index) == index, constant

    def test_it_starts_from_any_snapshot(self, module: ModuleType, tried: list[LawParams]) -> None:
        draw = random.Random(1)
        for params in tried:
            for _ in range(50):
                snapshot = _snapshot(draw)
                state = _started(module, params, snapshot)
                _check_state(module, state, _Place(params, snapshot))

    @pytest.mark.parametrize("seed", SEEDS)
    def test_finite_ticks_give_a_finite_force_and_a_state_of_numbers(
        self, module: ModuleType, tried: list[LawParams], seed: int
    ) -> None:
        """Jumps, frozen samples, forces of 1e18 N, times of a nanosecond: within what `LawTick` promises."""
        draw = random.Random(seed)
        for params in tried:
            for _ in range(SEQUENCES):
                snapshot = _snapshot(draw)
                state = _started(module, params, snapshot)
                plain = plain_object("Params", scalar_params(params))
                ticks = _ticks(draw)
                for at, tick in enumerate(3 * ticks):
                    where = _Place(params, snapshot, at, tick)
                    _check_number(_stepped(module, state, plain, tick, where), where)
                    _check_state(module, state, where)

    def test_a_device_outside_the_wall_feels_nothing(self, module: ModuleType, tried: list[LawParams]) -> None:
        """Tapped, drawn back and tapped again by the daemon's own tick, which must not fall back on another law."""
        for params in tried:
            table = params.model_dump(exclude_unset=True)
            tapped = pressed(module.__name__, table, start_m=0.003, device={"hand": {"force": _TAPPING}})
            made = rehearse(tapped, 1.0)
            assert made.fault is None, f"{params!r}: {made.fault}"
            outside = [force for x, force in zip(made.x_measured_m, made.force_n, strict=True) if not x < 0.0]
            assert 10 < len(outside) < len(made.force_n), "it was tapped and it was let go"
            assert not any(outside), f"{params!r} pushes outside the wall"

    def test_one_that_rests_outside_the_wall_misses_nothing_there(
        self, module: ModuleType, tried: list[LawParams]
    ) -> None:
        """`RESTS_OUTSIDE = True`: asked at every sample or only as the loop asks it, it answers the same inside."""
        if not rests_outside(module):
            return
        draw = random.Random(3)
        for params in tried:
            for out_of_reach in 3 * (False, True):
                snapshot = _snapshot(draw)
                if out_of_reach:
                    snapshot.x_m, snapshot.applied_n = abs(snapshot.x_m), 0.0
                plain = plain_object("Params", scalar_params(params))
                always, rested = (_started(module, params, snapshot) for _ in range(2))
                applied_n = 0.0
                asked = awake = not out_of_reach
                for at, tick in enumerate(_taps(draw)):
                    tick.applied_n = tick.applied_contact_n = applied_n
                    force_n = module.step(always, plain, tick)
                    if tick.in_contact or awake:
                        asked = True
                        where = _Place(params, snapshot, at, tick)
                        answer_n = module.step(rested, plain, tick)
                        assert not tick.in_contact or answer_n == force_n, f"{where}"
                        awake = tick.in_contact or applied_n != 0.0
                    for name in _SHOWN if asked else ():
                        assert getattr(rested, name, 0.0) == getattr(always, name, 0.0), f"State.{name}: {where}"
                    applied_n = max(-12.0, min(force_n, 12.0)) if tick.in_contact else 0.0

    def test_interpreted_and_compiled_agree_to_the_last_bit(self, module: ModuleType, tried: list[LawParams]) -> None:
        """On presses and releases, and on ticks that a broken device could cause."""
        pytest.importorskip("numba", reason="the extra `study` brings it: pip install 'hapticd[study]'")
        from hapticd.testing.law_machine import LawMachine

        draw = random.Random(2)
        for params in tried:
            for make in (_taps, _ticks):
                snapshot = _snapshot(draw)
                state = _started(module, params, snapshot)
                plain = plain_object("Params", scalar_params(params))
                machine = LawMachine(module, state, plain)
                applied_n = 0.0
                for at, tick in enumerate(make(draw)):
                    tick.applied_n = tick.applied_contact_n = applied_n
                    force_n = module.step(state, plain, tick)
                    where = _Place(params, snapshot, at, tick)
                    assert machine.step(tick) == force_n, f"{where}"
                    for name in state_fields(module):
                        assert machine.state[name] == getattr(state, name), f"State.{name}: {where}"
                    applied_n = max(-12.0, min(force_n, 12.0)) if tick.in_contact else 0.0


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a law has failed; put in words only then, since that takes longer than the tick."""

    params: LawParams
    snapshot: LawSnapshot
    at: int = -1
    tick: LawTick | None = None

    def __str__(self) -> str:
        started = f"{self.params!r} started from {self.snapshot}"
        return started if self.tick is None else f"{started}, then at tick {self.at}: {self.tick}"


def _choices(module: ModuleType) -> dict[str, tuple[Any, ...]]:
    """Parameters that choose among literals, with all that they may be."""
    return {
        name: typing.get_args(info.annotation)
        for name, info in module.Params.model_fields.items()
        if typing.get_origin(info.annotation) is Literal
    }


def _number(draw: random.Random) -> float:
    """A finite number: of a device, tiny, special, or any at all."""
    kind = draw.randrange(4)
    if kind == 0:
        return draw.uniform(-20.0, 20.0)
    if kind == 1:
        return draw.uniform(-1e-3, 1e-3)
    if kind == 2:
        return draw.choice([0.0, -0.0, 1e-3, 5e-324, -1e-300, 1e308, -1e308])
    while True:
        any_float: float = struct.unpack("d", draw.randbytes(8))[0]
        if math.isfinite(any_float):
            return any_float


def _snapshot(draw: random.Random) -> LawSnapshot:
    return LawSnapshot(
        x_m=_number(draw),
        velocity_m_per_s=_number(draw),
        applied_n=_number(draw),
        debt_j=abs(_number(draw)),
        damping_n_s_per_m=_number(draw),
    )


def _ticks(draw: random.Random) -> list[LawTick]:
    """Ticks that a broken device could cause; now and then one comes again."""
    ticks: list[LawTick] = []
    for _ in range(draw.randint(1, 40)):
        if ticks and draw.random() < 0.1:
            ticks.append(ticks[-1])
            continue
        tick = LawTick(abs(_number(draw)))
        for name, most in _LARGEST.items():
            setattr(tick, name, max(-most, min(_number(draw), most)))
        tick.dt_s = 1e-3 if draw.random() < 0.5 else 10.0 ** draw.uniform(-9.0, 0.0)
        tick.in_contact = tick.x_m < 0.0
        ticks.append(tick)
    return ticks


def _taps(draw: random.Random) -> list[LawTick]:
    """Presses and releases of a wall, as a position sensor of 10 um shows them."""
    stiffness_n_per_m, hertz = draw.uniform(3e3, 3e4), draw.uniform(1.0, 8.0)
    depth_m, offset_m = draw.uniform(5e-4, 3e-3), draw.uniform(-1e-3, 1e-3)
    ticks: list[LawTick] = []
    before_m = 0.0
    for at in range(1500):
        x_m = 1e-5 * round((offset_m + depth_m * math.cos(2.0 * math.pi * hertz * at * 1e-3)) / 1e-5)
        tick = LawTick(1e-5, x_m=x_m, moved_m=x_m - before_m, velocity_m_per_s=(x_m - before_m) / 1e-3)
        tick.in_contact = x_m < 0.0
        tick.contact_n = tick.spring_n = -stiffness_n_per_m * x_m if x_m < 0.0 else 0.0
        ticks.append(tick)
        before_m = x_m
    return ticks


def _started(module: ModuleType, params: LawParams, snapshot: LawSnapshot) -> Any:
    """A state from which the law goes on."""
    state = fresh_state(module)
    try:
        module.start(state, plain_object("Params", scalar_params(params)), snapshot)
    except Exception as error:
        error.add_note(f"{_Place(params, snapshot)}")
        raise
    return state


def _stepped(module: ModuleType, state: Any, params: Any, tick: LawTick, where: _Place) -> Any:
    try:
        return module.step(state, params, tick)
    except Exception as error:
        error.add_note(f"{where}")
        raise


def _check_number(force_n: object, where: _Place) -> None:
    assert type(force_n) in (float, int), f"a force of {force_n!r}: {where}"
    assert math.isfinite(typing.cast("float", force_n)), f"a force of {force_n!r}: {where}"


def _check_state(module: ModuleType, state: Any, where: _Place) -> None:
    """Every field is a finite number of its declared kind; a whole number serves where a float is declared."""
    for name, kind in state_fields(module).items():
        value = getattr(state, name)
        allowed: tuple[type[Scalar], ...] = (float, int) if kind is float else (kind,)
        assert type(value) in allowed, f"State.{name} is declared as {kind.__name__} and is {value!r}: {where}"
        assert math.isfinite(value), f"State.{name} = {value!r}: {where}"
