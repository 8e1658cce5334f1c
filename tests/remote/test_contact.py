"""`hapticd/contact` tells of each tick what clients push the device with, and which of their messages is in force."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pytest

from hapticd.client import RemotePort, RemoteState
from hapticd.tick.record import TickRecord
from tests.daemon.running import Daemon, Subscriber, all_records, wait_until
from tests.remote.stage import driven

BALL, TOOL, FIELD = range(3)
AT_M = [[0.0, 0.0, -0.025], [0.01, 0.0, 0.0], [0.0, 0.0, 0.0]]
SCENE = """
[device.options]
model = "omega7"
axes = 3

[device.options.space.hand]
stiffness_n_per_m = [300.0, 300.0, 300.0]
damping_n_s_per_m = [5.0, 5.0, 5.0]

[remote]
law = "none"

[[scene.objects]]
name = "still"
shape = "sphere"
radius_m = 0.01
position_m = [0.1, 0.0, 0.0]
stiffness_n_per_m = 500.0

[[scene.objects]]
name = "ball"
shape = "sphere"
radius_m = 0.03
position_m = [0.0, 0.0, -0.05]
stiffness_n_per_m = 1000.0
remote = true
hold_s = 2.0

[[scene.couplings]]
name = "tool"
stiffness_n_per_m = 300.0
max_force_n = 6.0
hold_s = 2.0

[[scene.forces]]
name = "field"
max_force_n = 3.0
hold_s = 2.0
unchanged_s = 0.0
"""


def test_an_experiment_learns_from_which_tick_on_a_change_holds() -> None:
    with (
        Daemon(SCENE).wait_ready() as daemon,
        Subscriber(daemon.endpoint, "hapticd/contact", "hapticd/status") as subscriber,
        driven(daemon, "ball") as ball,
        driven(daemon, "tool") as tool,
    ):
        assert subscriber.until("hapticd/status")["remote_name"] == ["ball", "tool", "field"]
        with driven(daemon, "field") as field:
            first = drive(ball, tool, field)
            tool.change(stiffness_n_per_m=100.0)
            ball.change(stiffness_n_per_m=500.0)
            asked = {TOOL: tool.seq, BALL: ball.seq}
            settled(ball, tool)
            last = drive(ball, tool, field)
        wait_until(lambda: not any(tool.state(20.0).ports["field"].force_n), "the force to be out")
        end = tool.state(20.0).seq
        told: dict[int, list[dict[str, Any]]] = defaultdict(list)
        for topic, fields in subscriber.maps():
            if topic == "hapticd/contact":
                told[fields["seq"]].append(fields)
                if fields["seq"] > end:
                    break
        memory = daemon.memory(axes=3)
        records = {record.seq: record for record in all_records(memory) if first <= record.seq <= end}
        memory.close()

    for seq in range(first, last):
        assert [one["remote"] for one in told[seq]] == [BALL, TOOL, FIELD]
        assert [one.get("object") for one in told[seq]] == [1, None, None]
        for one, at_m in zip(told[seq], AT_M, strict=True):
            assert one["target_m"] == pytest.approx(at_m, abs=1e-4)
        pushed_n = [sum(parts) for parts in zip(*(one["force_n"] for one in told[seq]), strict=True)]
        assert pushed_n == pytest.approx(records[seq].force_n, abs=1e-9), "nothing else pushes"
    for index, before_n_per_m in ((TOOL, 300.0), (BALL, 1000.0)):
        holds = min(seq for seq in range(first, last) if told[seq][index]["remote_seq"] >= asked[index])
        stiffness = [stiffness_of(records[seq], index) for seq in (holds - 1, holds)]
        assert stiffness[0] == before_n_per_m > stiffness[1], "it goes by a ramp, which begins in that tick"
    fading = [one for seq in range(last, end) for one in told[seq] if one["remote"] == FIELD and one["remote_seq"] < 0]
    assert any(any(one["force_n"]) for one in fading)
    assert FIELD not in {one["remote"] for one in told[end]}


def drive(ball: RemotePort, tool: RemotePort, field: RemotePort) -> int:
    """Say everything in each of some ticks, until it is in force; the last tick."""
    for _ in range(80):
        ball.move(AT_M[BALL])
        tool.move(AT_M[TOOL])
        field.push([0.0, 0.5, 0.0])
        tool.state(20.0)
    return settled(ball, tool, field)


def settled(*clients: RemotePort) -> int:
    """Wait until what each has said last is in force; the newest tick."""

    def state() -> RemoteState:
        return clients[0].state(20.0)

    wait_until(lambda: all(state().ports[one.name].seq >= one.seq for one in clients), "it to be in force")
    return state().seq


def stiffness_of(record: TickRecord, index: int) -> float:
    """Of what a client drives, in one tick [N/m]."""
    assert record.ports is not None
    return record.ports.shown[index].stiffness_n_per_m
