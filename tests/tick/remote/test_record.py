"""A record of a tick with ports says of each how it stands, and comes back as it was packed."""

from __future__ import annotations

import csv
import io

import pytest

from hapticd.config.walls import MAX_WALLS
from hapticd.faults.export import write_csv
from hapticd.faults.record import FaultRecord
from hapticd.telemetry.wire import Objects, contact_maps, damping_map, energy_map
from hapticd.tick.record import RecordLayout, TickRecord
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import COUPLING, FORCE_PORT, WALL, Rig

BALL = '[[scene.objects]]\nname = "ball"\nshape = "sphere"\nradius_m = 0.03\nstiffness_n_per_m = 500.0\n'
MOVING = BALL + "position_m = [0.0, 0.0, -0.05]\nremote = true\n"


def recorded(rig: Rig) -> TickRecord:
    layout = RecordLayout(len(rig.at), False, MAX_WALLS)
    layout.serve(rig.tick)
    area = memoryview(bytearray(b"\xa5" * layout.size))
    layout.pack(area, 0, rig.tick, rig.sample, 7, 1000, 1.0, 2.0, 0, 1)
    return layout.unpack(area)


@pytest.mark.parametrize(
    ("axes", "scene"), [("x", ""), ("xy", WALL), ("xyz", WALL), ("xyz", BALL + WALL), ("xyz", BALL)]
)
def test_it_says_how_each_port_stands(axes: str, scene: str) -> None:
    rig = Rig(scene + COUPLING + FORCE_PORT, law="ring-damping", axes=axes)
    rig.go([0.05] * len(axes))
    for _ in range(200):
        rig.say("tool", position_m=[0.051] * len(axes))
        rig.go()
    record = recorded(rig)
    assert record.ports is not None
    assert (record.ports.count, record.ports.objects) == (2, 0)
    tool, field = record.ports.shown
    port = rig["tool"]
    assert (tool.index, tool.object, tool.state, tool.seq) == (0, -1, PortState.HELD, rig.seq)
    assert tool.age_s == pytest.approx(1e-3)
    assert tool.stiffness_n_per_m == 2000.0
    assert tool.damping_n_s_per_m == max(channel.damping_n_s_per_m for channel in port.channels) > 0.0
    assert list(tool.force_n) == port.force_n == pytest.approx([2.0] * len(axes), abs=1e-4)
    assert list(tool.impulse_n_s) == port.impulse_n_s
    assert list(tool.target_m) == pytest.approx([0.051] * len(axes))
    assert tool.work_j == port.work_j == record.ports.work_j > 0.0
    assert (field.index, field.state, field.seq, field.force_n) == (1, PortState.IDLE, -1, (0.0,) * len(axes))
    assert len(record.walls) == scene.count("walls")
    assert (record.space is not None) == ("objects" in scene)
    totals = rig.tick.totals().ledger
    assert contact_maps(record, 0.5) == [
        {
            "timestamp": 0.5,
            "seq": 7,
            "force_n": list(tool.force_n),
            "remote": 0,
            "remote_seq": rig.seq,
            "target_m": list(tool.target_m),
        }
    ], "the force is not in force, and nothing is touched"
    assert (record.energy_j, record.spring_energy_j) == (totals.energy_j, totals.stored_j)
    seen = damping_map(record, 0.0, Objects().see(record))
    assert seen["in_contact"][-2:] == [True, False]
    assert seen["damping_n_s_per_m"][-2:] == [tool.damping_n_s_per_m, 0.0]
    assert len(seen["in_contact"]) == 2 + scene.count("[[")
    energy = energy_map(record, 0.0)
    balance = energy["spring_energy_j"] + energy["dissipated_j"] - energy["generated_j"] - energy["scene_work_j"]
    assert energy["energy_j"] == pytest.approx(balance, abs=1e-12)


def test_more_ports_than_a_record_has_room_for_leave_out_objects_and_never_a_coupling() -> None:
    couplings = "".join(COUPLING.replace('"tool"', f'"{n}"') for n in range(16))
    rig = Rig(couplings, axes="xyz")
    record = recorded(rig)
    assert record.ports is not None
    assert [one.index for one in record.ports.shown] == list(range(16))


def test_a_table_of_a_fault_has_of_each_port_the_message_in_force() -> None:
    rig = Rig(MOVING + COUPLING, axes="xyz")
    rig.go([0.0, 0.0, 0.0])
    rig.say("ball", position_m=[0.0, 0.0, -0.02])
    rig.go(ticks=20)
    rig.say("tool", position_m=[0.01, 0.0, 0.0])
    rig.go(ticks=20)
    table = io.StringIO()
    write_csv(FaultRecord("one", {"event": {"deadline_ns": 0}}, [recorded(rig)]), table)
    table.seek(0)
    (row,) = csv.DictReader(table)
    assert (row["object[port 0]"], row["seq[port 0]"]) == ("0", "1")
    assert (row["object[port 1]"], row["seq[port 1]"]) == ("-1", "2")
    assert float(row["target_m[port 0][2]"]) == rig["ball"].target_m[2]
    assert float(row["force_n[port 1][0]"]) == rig["tool"].force_n[0] > 0.0
    assert None not in row, "every value has its column"
