"""What a client hears of a tick is what the tick did: each key has its own number."""

from __future__ import annotations

import pytest

from hapticd.remote.delays import DELAY_EDGES_MS, DelayHistogram
from hapticd.remote.state_map import state_map
from hapticd.tick.flags import Flag
from hapticd.tick.record import RecordLayout, TickRecord
from hapticd.tick.remote.port_record import PortRecord, PortsRecord
from hapticd.tick.remote.port_state import PortState


def port(index: int, number: float) -> PortRecord:
    """A port whose every number is another one."""
    vectors = [(number + 0.1 * at,) for at in range(3)]
    return PortRecord(
        index, -1, PortState.HELD, 7, number + 0.5, number + 0.6, number + 0.7, number + 0.8, number + 0.9, *vectors
    )


def record(*ports: PortRecord, flags: int = 0, orientation: tuple[float, ...] = ()) -> TickRecord:
    layout = RecordLayout(1, False, 1)
    made = layout.unpack(bytes(layout.size))
    made.seq, made.deadline_ns, made.dt_s, made.flags, made.buttons = 41, 2_000_000_000, 0.002, flags, 5
    made.position_m, made.velocity_m_per_s, made.force_n = (0.25,), (0.5,), (0.75,)
    made.orientation = orientation
    made.ports = PortsRecord(len(ports), 0, 0.0, ports)
    return made


def test_a_tick_is_told_with_all_that_was_in_it() -> None:
    told = state_map(
        record(port(0, 10.0), port(1, 20.0), flags=int(Flag.ARMED)), [("tool", 3), ("field", 4)], 500_000_000
    )
    ports = told.pop("ports")
    assert told == {
        "seq": 41,
        "timestamp": pytest.approx(2.5),
        "deadline_ns": 2_000_000_000,
        "dt_s": 0.002,
        "armed": True,
        "position_m": (0.25,),
        "velocity_m_per_s": (0.5,),
        "force_n": (0.75,),
        "buttons": 5,
    }
    assert ports["field"] == {
        "since_ns": 4,
        "target_m": (20.0,),
        "force_n": (20.1,),
        "impulse_n_s": (20.2,),
        "seq": 7,
        "age_s": 20.5,
        "state": "held",
        "work_j": 20.9,
    }
    assert ports["tool"]["work_j"] == 10.9


def test_a_device_that_turns_is_told_with_its_orientation_and_another_flag_is_not_armed() -> None:
    told = state_map(record(flags=~int(Flag.ARMED), orientation=(1.0, 0.0, 0.0, 0.0)), [], 0)
    assert told["orientation"] == (1.0, 0.0, 0.0, 0.0)
    assert told["armed"] is False


def test_a_port_whose_name_is_not_known_yet_is_not_told() -> None:
    assert state_map(record(port(0, 1.0), port(1, 2.0)), [("tool", 3)], 0)["ports"].keys() == {"tool"}
    assert state_map(record(port(0, 1.0)), [], 0)["ports"] == {}
    none = record()
    none.ports = None
    assert state_map(none, [("tool", 3)], 0)["ports"] == {}


def test_a_delay_is_counted_from_its_edge_on() -> None:
    for at, edge_ms in enumerate(DELAY_EDGES_MS):
        for delay_ns, bin_of_it in ((round(edge_ms * 1e6), at + 1), (round(edge_ms * 1e6) - 1, at)):
            histogram = DelayHistogram()
            histogram.add(delay_ns)
            assert histogram.counts == [int(each == bin_of_it) for each in range(12)]
    assert DELAY_EDGES_MS[0] == 0.25
    assert DELAY_EDGES_MS[-1] == 256.0
