"""Hostile laws: whatever a law does, what is written is finite, bounded and ramped."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hapticd.config.safety import SafetyConfig
from hapticd.errors import PluginError
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd.tick.guard import Mode
from tests.tick.rig import LIMIT_N, RAMP_TICKS, Rig, largest_step, law, returns, running, scene, wall
from tests.tick.transitions import pressed


class UnprintableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("not even this")


class Rude(BaseException):
    pass


def raises(error: BaseException) -> Callable[[Any, Any, Any], Any]:
    def step(_state: Any, _params: Any, _tick: Any) -> Any:
        raise error

    return step


def spoils(value: Any) -> Callable[[Any, Any, Any], Any]:
    """Writes nonsense into all that it is shown, then fails."""

    def step(_state: Any, _params: Any, tick: Any) -> Any:
        for field in tick.__slots__:
            setattr(tick, field, value)
        raise ValueError("spoilt")

    return step


def recurses(state: Any, params: Any, tick: Any) -> Any:
    return recurses(state, params, tick)


BAD_LAWS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "raises": raises(ValueError("no")),
    "raises what cannot be printed": raises(UnprintableError()),
    "exits": raises(SystemExit(3)),
    "ends a generator": raises(GeneratorExit()),
    "raises a base exception": raises(Rude()),
    "stops an iteration": raises(StopIteration()),
    "recurses": recurses,
    "divides": lambda _state, _params, tick: 1.0 / (tick.dt_s - tick.dt_s),
    "None": returns(None),
    "text": returns("5.0"),
    "NaN": returns(math.nan),
    "infinity": returns(math.inf),
    "minus infinity": returns(-math.inf),
    "1e300": returns(1e300),
    "complex": returns(1.0 + 0.0j),
    "a huge whole number": returns(10**400),
    "a list": returns([1.0]),
    "an array": returns(np.array([1.0])),
    "a decimal": returns(Decimal(1)),
    "an object": returns(object()),
    "spoils with NaN": spoils(math.nan),
    "spoils with text": spoils("x"),
    "spoils with None": spoils(None),
}


@pytest.mark.parametrize("name", BAD_LAWS)
def test_a_law_that_fails_is_replaced_by_damping_and_the_force_ramped_to_zero(name: str) -> None:
    """It fails pressed at 4 N: the loop goes on, no step, zero after one ramp, latched; then all is well again."""
    fails = BAD_LAWS[name]
    failing = False

    def step(state: Any, params: Any, tick: Any) -> Any:
        return fails(state, params, tick) if failing else tick.contact_n

    rig = pressed(module=law(step))
    forces = rig.forces(-2e-3, 3)
    failing = True
    forces += rig.forces(-2e-3, 1)
    assert rig.tick.fault == EventCode.LAW_FAILED
    assert rig.tick.fault_text.startswith("law tests.some_law: ")
    assert rig.tick.flags & Flag.FALLBACK
    assert rig.tick.flags & Flag.LATCHED
    forces += rig.forces(-2e-3, RAMP_TICKS)
    assert forces[:3] == [4.0] * 3
    assert largest_step(forces) <= 4.0 / RAMP_TICKS + 1e-9
    assert forces[RAMP_TICKS + 2] == pytest.approx(0.0, abs=1e-12)
    assert rig.forces(-2e-3, 10) == [0.0] * 10
    assert not rig.tick.arm()
    assert all(map(math.isfinite, rig.books_j))

    failing = False
    rig.tick.guard.clear()
    assert rig.tick.arm()
    assert not rig.tick.fallback
    assert rig.forces(-2e-3, RAMP_TICKS + 1) == pytest.approx([4.0 * n / RAMP_TICKS for n in range(RAMP_TICKS + 1)])


@pytest.mark.parametrize("value", [-0.0, 0, 5, True, np.float64(2.0), 1e17])
def test_what_is_a_number_is_taken_for_one(value: Any) -> None:
    rig = Rig(wall(2000.0), module=law(returns(value)), at_m=0.0)
    written_n = rig.force(-2e-3)
    assert written_n == min(float(value), LIMIT_N)
    assert type(written_n) is float
    assert type(rig.tick.requested_n[0]) is float
    assert rig.tick.fault == 0


@pytest.mark.parametrize("value", [math.nan, "x", None, 0.0, -5e-324, 1e308])
def test_what_a_law_writes_into_its_tick_reaches_neither_force_nor_books_nor_the_next_tick(value: Any) -> None:
    def step(_state: Any, _params: Any, tick: Any) -> float:
        force_n: float = tick.contact_n
        for field in tick.__slots__:
            setattr(tick, field, value)
        return force_n

    honest, spoilt = Rig(wall(2000.0), at_m=0.0), Rig(wall(2000.0), at_m=0.0, module=law(step))
    for count in range(200):
        position_m = 4e-3 * math.sin(0.1 * count)
        assert spoilt.at(position_m) == honest.at(position_m)
        assert spoilt.books_j == honest.books_j
    assert spoilt.tick.fault == 0


@pytest.mark.parametrize("value", [math.nan, math.inf, "x", None, 1e300, 2.0j])
@pytest.mark.parametrize("field", ["damping_n_s_per_m", "felt_mass_kg"])
def test_a_law_that_publishes_nonsense_has_failed(field: str, value: Any) -> None:
    def step(state: Any, _params: Any, tick: Any) -> float:
        setattr(state, field, value)
        force_n: float = tick.contact_n
        return force_n

    rig = Rig(wall(2000.0), at_m=0.01, module=law(step, fields={field: float}))
    rig.force(0.01)
    assert rig.tick.fault == EventCode.LAW_FAILED
    contact = rig.tick.contacts[0]
    assert type(contact.damping_n_s_per_m) is float
    assert contact.damping_n_s_per_m == 10.0
    assert contact.felt_mass_kg == 0.0


def test_one_law_of_several_that_fails_takes_all_of_them_with_it_and_no_force_steps() -> None:
    calls = 0

    def step(_state: Any, _params: Any, tick: Any) -> float:
        nonlocal calls
        calls += 1
        if calls > 40 and tick.x_m > -1.5e-3:
            raise ValueError("only here")
        force_n: float = tick.contact_n
        return force_n

    rig = Rig(wall(2000.0, "x"), wall(1000.0, "y"), axes="xy", at_m=0.0, module=law(step))
    forces = rig.at(-2e-3, -1e-3, ticks=80)
    assert rig.tick.fault == EventCode.LAW_FAILED
    for axis, newton in ((0, 4.0), (1, 1.0)):
        assert forces[0][axis] == pytest.approx(newton)
        assert largest_step([force_n[axis] for force_n in forces]) == pytest.approx(newton / RAMP_TICKS)
        assert forces[-1][axis] == 0.0


def test_the_fallback_damps_while_the_force_is_ramped_out() -> None:
    rig = pressed(module=law(returns(math.nan)), depth_m=1e-3)
    for count in range(1, 30):
        before_n = rig.tick.force_n[0]
        force_n = rig.force(-1e-3 - 1e-5 * count)
    assert rig.tick.requested_n[0] == pytest.approx(2000.0 * (1e-3 + 29e-5) + 10.0 * 0.01)
    assert force_n < before_n


def test_an_interrupt_from_the_keyboard_is_no_fault_of_the_law() -> None:
    """A study is stopped by it; the control process never sees one."""
    interrupted = law(raises(KeyboardInterrupt()), raises(KeyboardInterrupt()))
    rig = Rig(wall(2000.0), at_m=0.0, module=law(interrupted.step))
    with pytest.raises(KeyboardInterrupt):
        rig.force(-1e-3)
    with pytest.raises(KeyboardInterrupt):
        rig.switch(make_law=running(interrupted))


@pytest.mark.parametrize("error", [ValueError("no"), SystemExit(2), Rude()])
def test_a_law_that_cannot_start_changes_nothing(error: BaseException) -> None:
    def start(_state: Any, _params: Any, _snapshot: Any) -> None:
        raise error

    broken = running(law(returns(9.0), start))
    rig = pressed(wall(2000.0), wall(500.0, position_m=-1.0))
    before_n = rig.force(-2e-3)
    contacts = list(rig.tick.contacts)
    deeds: list[Callable[[], None]] = [
        lambda: rig.switch(make_law=broken),
        lambda: rig.switch(scene(wall(7.0)), SafetyConfig(max_force_n=2.0, ramp_s=0.5), broken),
    ]
    for deed in deeds:
        with pytest.raises(PluginError, match=r"law tests\.some_law cannot start"):
            deed()
    assert rig.force(-2e-3) == before_n
    assert rig.tick.contacts == contacts
    assert rig.tick.ramp_s == 0.05
    assert rig.tick.guard.max_force_n == LIMIT_N
    rig.tick.release()
    rig.force(-2e-3, ticks=60)
    assert rig.tick.arm()


UNDECLARED = """
from hapticd.law import LawParams
class Params(LawParams): pass
class State:
    seen: float
def start(state, params, snapshot):
    state.seen = snapshot.x_m{0}
def step(state, params, tick):
    return state.speed * params.gain if tick.x_m < -2e-3 else tick.contact_n
"""


def test_a_law_that_uses_a_field_that_it_does_not_declare_is_told_where_and_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "undeclared.py").write_text(UNDECLARED.format(""))
    (tmp_path / "at_start.py").write_text(UNDECLARED.format("; state.begun = 1.0"))
    monkeypatch.syspath_prepend(tmp_path)
    rig = pressed(wall(2000.0))
    with pytest.raises(PluginError) as refused:
        rig.switch(make_law=running(importlib.import_module("at_start")))
    said = "has no field {0}: declare it there, `{0}: float` ({1})"
    assert str(refused.value) == f"law at_start cannot start: State {said.format('begun', 'at_start.py:7')}"
    rig.switch(make_law=running(importlib.import_module("undeclared")))
    rig.force(-3e-3)
    assert rig.tick.fault_text == f"law undeclared: State {said.format('speed', 'undeclared.py:9')}"


def test_a_law_that_cannot_start_cannot_be_armed() -> None:
    allowed = True

    def start(_state: Any, _params: Any, _snapshot: Any) -> None:
        if not allowed:
            raise ValueError("not now")

    rig = Rig(wall(2000.0), module=law(returns(1.0), start), arm=False)
    allowed = False
    with pytest.raises(PluginError):
        rig.tick.arm()
    assert rig.tick.guard.mode is Mode.DISARMED


def test_a_law_that_is_armed_before_the_first_tick_is_told_that_the_device_rests() -> None:
    """T5."""
    told: list[Any] = []
    watching = law(returns(0.0), lambda _state, _params, snapshot: told.append(snapshot))
    Rig(wall(2000.0), module=watching, at_m=-4e-3)
    assert [(snapshot.x_m, snapshot.velocity_m_per_s, snapshot.applied_n) for snapshot in told] == [
        (-4e-3, 0.0, 0.0)
    ] * 2
