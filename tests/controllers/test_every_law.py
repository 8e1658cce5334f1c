"""What every built-in law keeps: finite forces, one set of bits, choices in the order of their constants."""

from __future__ import annotations

import importlib
import math
import random
import struct
import sys
import typing
from collections.abc import Generator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd import plugins
from hapticd.law import (
    LawParams,
    LawSnapshot,
    LawTick,
    check_law,
    fresh_state,
    plain_object,
    rests_outside,
    scalar_params,
)
from hapticd.testing.law_contract import LawContract
from hapticd_controllers import (
    damper,
    energy_bounding,
    energy_cycle,
    input_to_state,
    late_cycle,
    none,
    ring_damping,
    set_position,
    tdpa,
    virtual_coupling,
)
from tests.examples import examples

from . import machine
from .plant import Device, Rig

LAWS = (
    none,
    damper,
    virtual_coupling,
    ring_damping,
    energy_cycle,
    late_cycle,
    tdpa,
    energy_bounding,
    input_to_state,
    set_position,
)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
NUMBER = st.one_of(st.floats(-20.0, 20.0), st.floats(-1e-3, 1e-3), st.sampled_from([0.0, 1e-3, 5e-324, -1e308]), FINITE)
LONGEST = {"x_m": 1e8, "moved_m": 1e8, "velocity_m_per_s": 1e6, "contact_n": 1e18, "applied_n": 1e18}
LONGEST["applied_contact_n"] = LONGEST["spring_n"] = LONGEST["contact_n"]
"""What `LawTick` promises of its numbers."""
each_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__.rpartition(".")[2])


def choices(law: ModuleType) -> dict[str, tuple[str, ...]]:
    return {
        name: typing.get_args(info.annotation)
        for name, info in law.Params.model_fields.items()
        if typing.get_origin(info.annotation) is typing.Literal
    }


def readings(law: ModuleType) -> list[LawParams]:
    """The defaults, and every other choice for itself."""
    others = [{name: choice} for name, each in choices(law).items() for choice in each]
    return [law.Params(), *(law.Params.model_validate(other) for other in others)]


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Generator[ModuleType]:
    """The law that docs/controllers.md shows."""
    page = (Path(__file__).parents[2] / "docs" / "controllers.md").read_text()
    (tmp_path / "law_of_the_docs.py").write_text(page.split("```python\n")[1].split("```")[0])
    monkeypatch.syspath_prepend(str(tmp_path))
    yield importlib.import_module("law_of_the_docs")
    del sys.modules["law_of_the_docs"]


def test_the_example_of_the_docs_is_a_law(example: ModuleType) -> None:
    check_law(example)
    steady = Device(stiffness_n_per_m=12e3, x_m=0.002)
    plain = Rig(example, steady)
    assert plain.run(3.0).held
    assert not Rig(none, steady).run(3.0).held
    compiled = Rig(example, steady, drive=machine.drive)
    compiled.run(3.0)
    assert bits(plain.plant) == bits(compiled.plant)


def bits(plain: Any) -> dict[str, bytes]:
    return {name: struct.pack("d", getattr(plain, name)) for name in type(plain).__slots__}


class TestEveryLaw(LawContract):
    """What the author of any law runs, on every law that is installed here."""

    @pytest.fixture(params=plugins.names(plugins.CONTROLLERS))
    def module(self, request: pytest.FixtureRequest) -> ModuleType:
        return plugins.law(request.param)


@each_law
def test_only_laws_that_keep_time_are_asked_outside_a_wall(law: ModuleType) -> None:
    """A ring dies away there, and a coupling swings; for the others asking would cost a tick for nothing."""
    assert rests_outside(law) == (law not in (ring_damping, virtual_coupling))


@each_law
def test_a_start_leaves_nothing_of_what_came_before_it(law: ModuleType) -> None:
    """A law is started again on the state it has, where the surface has turned away under it."""
    snapshot = LawSnapshot(-1e-3, 0.02, 3.0, 2e-3, 40.0)
    for given_params in readings(law):
        params = plain_object("Params", scalar_params(given_params))
        fresh, used = fresh_state(law), fresh_state(law)
        for name in type(used).__slots__:
            setattr(used, name, type(getattr(used, name))(7))
        for state in (fresh, used):
            law.start(state, params, snapshot)
        assert bits(used) == bits(fresh)


@each_law
def test_outside_a_wall_no_law_asks_for_a_force_but_the_bare_damper(law: ModuleType) -> None:
    """That one brakes wherever it is asked, and the loop sends nothing there."""
    resting_n = -100.0 if law is damper else 0.0
    state, params = fresh_state(law), plain_object("Params", scalar_params(law.Params()))
    law.start(state, params, LawSnapshot(-1e-3, 0.02, 3.0, 2e-3, 40.0))
    law.step(state, params, LawTick(x_m=-1e-3, in_contact=True, contact_n=8.0, spring_n=8.0))
    for _ in range(3):
        assert (
            law.step(state, params, LawTick(x_m=1e-3, moved_m=2e-3, velocity_m_per_s=2.0, applied_n=8.0)) == resting_n
        )


@pytest.mark.parametrize(
    "law", [tdpa, energy_cycle, late_cycle, energy_bounding, set_position], ids=lambda law: law.__name__
)
def test_a_debt_beyond_all_bounds_stays_a_debt_and_a_credit_is_none(law: ModuleType) -> None:
    state, params = fresh_state(law), plain_object("Params", scalar_params(law.Params()))
    law.start(state, params, LawSnapshot(debt_j=1e300))
    assert -1e15 < state.energy_j < -1e6
    law.start(state, params, LawSnapshot(debt_j=-1e300))
    assert state.energy_j == 0.0


@pytest.mark.parametrize("law", [damper, set_position], ids=lambda law: law.__name__.rpartition(".")[2])
def test_a_damping_that_is_set_is_published_from_the_start(law: ModuleType) -> None:
    state = fresh_state(law)
    law.start(state, law.Params(damping_n_s_per_m=33.0), LawSnapshot())
    assert state.damping_n_s_per_m == 33.0


@each_law
def test_a_choice_is_the_constant_of_its_name(law: ModuleType) -> None:
    """Compiled code knows no strings: `rule = "signed"` arrives as the index of the choice, RULE_SIGNED."""
    for name, each in choices(law).items():
        for index, choice in enumerate(each):
            assert getattr(law, f"{name}_{choice}".upper().replace("-", "_")) == index


@each_law
def test_interpreted_and_compiled_agree_to_the_last_bit(law: ModuleType) -> None:
    draw = random.Random(5)
    for params in readings(law):
        device = Device(
            mass_kg=draw.uniform(0.1, 0.5),
            viscous_n_s_per_m=draw.uniform(0.0, 6.0),
            resolution_m=draw.choice([0.0, 1e-6, 1e-5]),
            delay_samples=draw.randint(0, 1),
            stiffness_n_per_m=draw.uniform(3e3, 3e4),
            x_m=draw.uniform(0.0, 0.01),
        )
        plain, compiled = Rig(law, device, params), Rig(law, device, params, machine.drive)
        for _ in range(20):
            hand_n = draw.uniform(-8.0, 3.0)
            for rig in (plain, compiled):
                rig.change(hand_n=hand_n)
                rig.run(0.1)
            assert bits(plain.plant) == bits(compiled.plant)
            assert bits(plain.state) == bits(compiled.state)


@st.composite
def hostile_ticks(draw: st.DrawFn) -> list[LawTick]:
    ticks = []
    for _ in range(draw(st.integers(1, 40))):
        tick = LawTick(abs(draw(NUMBER)))
        for name, most in LONGEST.items():
            setattr(tick, name, max(-most, min(draw(NUMBER), most)))
        tick.dt_s = draw(st.one_of(st.just(1e-3), st.floats(1e-9, 1.0)))
        tick.in_contact = tick.x_m < 0.0
        ticks.append(tick)
    return ticks


@given(
    ticks=hostile_ticks(),
    found=st.lists(NUMBER, min_size=len(LawSnapshot.__slots__), max_size=len(LawSnapshot.__slots__)),
    reading=st.integers(0, 63),
)
@examples(120)
def test_finite_ticks_give_every_law_a_finite_force_and_a_state_of_numbers(
    ticks: list[LawTick], found: list[float], reading: int
) -> None:
    """The same ticks for all: to draw them takes ten times as long as to ask a law."""
    for law in LAWS:
        params = plain_readings(law)[reading % len(readings(law))]
        state = fresh_state(law)
        law.start(state, params, LawSnapshot(*found))
        for _ in range(3):
            for tick in ticks:
                force_n = law.step(state, params, tick)
                assert math.isfinite(force_n), law
                assert all(math.isfinite(getattr(state, name)) for name in type(state).__slots__), law


@cache
def plain_readings(law: ModuleType) -> list[Any]:
    """As a law gets them, which changes none."""
    return [plain_object("Params", scalar_params(params)) for params in readings(law)]
