"""The shipped coupling, on its own simulated device, driven as its page says."""

from __future__ import annotations

import math

import pytest

from hapticd.config.loading import load
from hapticd.offline.rehearsal import Rehearsal
from hapticd.paths import directory
from hapticd.tick.remote.port import PortState
from tests.tick.remote.rig import length, update

LOADED = load(directory("config") / "remote-tool.toml")


def test_without_a_client_the_hand_has_the_device_for_itself() -> None:
    rehearsal = Rehearsal(LOADED)
    for _ in rehearsal.run(200):
        assert rehearsal.tick.force_n == [0.0, 0.0, 0.0]


def test_a_client_at_60_hz_takes_the_device_around_a_circle_and_then_leaves_it() -> None:
    rehearsal = Rehearsal(LOADED.with_values({"scene.couplings[0].driven": True}))
    tick = rehearsal.tick
    (port,) = tick.ports
    assert (port.name, port.kind) == ("tool", "coupling")
    radius_m, pulse = 0.02, 2.0 * math.pi * 0.5
    far_m = []
    for n in rehearsal.run(3600):
        if n < 3000 and n % 17 == 0:
            turn = pulse * n * 1e-3
            sin, cos = math.sin(turn), math.cos(turn)
            said = update(
                n,
                position_m=[radius_m * cos, radius_m * sin, 0.0],
                velocity_m_per_s=[-radius_m * pulse * sin, radius_m * pulse * cos, 0.0],
            )
            port.take(said)
        assert length(tick.force_n) <= 6.0
        if 1000 < n < 3000:
            far_m.append(length(tick.motion.position_m))
    assert min(far_m) > 0.9 * radius_m
    assert max(far_m) < 1.05 * radius_m
    assert port.state is PortState.STALE
    assert tick.force_n == [0.0, 0.0, 0.0]
    totals = tick.totals()
    ledger = totals.ledger
    became = ledger.stored_j + ledger.dissipated_j - ledger.generated_j - totals.moved_j
    assert ledger.energy_j == pytest.approx(became, abs=1e-12)
    assert port.work_j > 1e-3
