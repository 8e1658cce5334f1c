"""What the author of a law holds in hand: ticks, snapshots and states, made by keyword and shown with their fields."""

from __future__ import annotations

import hapticd.driver
import hapticd.law
from hapticd.law import LawSnapshot, LawTick, fresh_state
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


def test_one_import_is_enough_to_write_a_law_and_one_to_write_a_driver() -> None:
    assert {"Field", "LawParams", "LawSnapshot", "LawTick"} <= set(hapticd.law.__all__)
    assert {"DeviceInfo", "Driver", "DriverOptions", "Field", "Sample"} <= set(hapticd.driver.__all__)
