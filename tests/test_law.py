"""What the author of a law holds in hand: ticks, snapshots and states, made by keyword and shown with their fields."""

from __future__ import annotations

from typing import Literal

import pytest

import hapticd.driver
import hapticd.law
from hapticd.errors import PluginError
from hapticd.law import LawParams, LawSnapshot, LawTick, fresh_state, scalar_params
from hapticd_controllers import tdpa


def test_a_tick_is_made_by_keyword_and_its_repr_makes_it_again() -> None:
    tick = LawTick(x_m=-1e-3, in_contact=True, contact_n=12.0, velocity_m_per_s=-0.1, resolution_m=1e-5)
    assert (tick.x_m, tick.in_contact, tick.contact_n, tick.velocity_m_per_s) == (-1e-3, True, 12.0, -0.1)
    again = eval(repr(tick))
    assert all(getattr(again, name) == getattr(tick, name) for name in LawTick.__slots__)


def test_a_tick_made_by_hand_keeps_what_a_law_is_promised() -> None:
    tick = LawTick()
    assert 1e-9 <= tick.dt_s <= 1.0
    assert not hasattr(tick, "__dict__")


def test_a_snapshot_is_made_by_keyword_and_its_repr_makes_it_again() -> None:
    snapshot = LawSnapshot(x_m=-2e-3, debt_j=0.01, damping_n_s_per_m=4.0)
    assert "debt_j=0.01" in repr(snapshot)
    again = eval(repr(snapshot))
    assert all(getattr(again, name) == getattr(snapshot, name) for name in LawSnapshot.__slots__)


def test_a_state_shows_its_fields() -> None:
    state = fresh_state(tdpa)
    state.energy_j = -0.25
    assert repr(state).startswith("hapticd_controllers.tdpa.State(energy_j=-0.25, ")


def test_parameters_arrive_as_numbers_and_a_choice_as_its_place() -> None:
    class Params(LawParams):
        gain: float = 2.5
        samples: int = 3
        signed: bool = True
        rule: Literal["last", "sum", None] = "sum"

    assert scalar_params(Params()) == {"gain": 2.5, "samples": 3, "signed": True, "rule": 1}
    assert scalar_params(Params(rule=None))["rule"] == 2


@pytest.mark.parametrize("value", [None, "x", (1.0, 2.0)])
def test_a_parameter_that_is_no_number_and_no_choice_is_refused_by_its_name(value: object) -> None:
    """C14: it was said that None arrives as -1, which a law would have taken for a number."""

    class Params(LawParams):
        cap: object = value

    with pytest.raises(PluginError, match=r"parameter cap = .*: a law takes numbers, bools and choices only"):
        scalar_params(Params())
    assert "None" not in str(scalar_params.__doc__)


def test_one_import_is_enough_to_write_a_law_and_one_to_write_a_driver() -> None:
    assert {"Field", "LawParams", "LawSnapshot", "LawTick"} <= set(hapticd.law.__all__)
    assert {"DeviceInfo", "Driver", "DriverOptions", "Field", "Sample"} <= set(hapticd.driver.__all__)
