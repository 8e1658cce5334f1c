"""A recorded motion under a law: the daemon's tick, fed with the positions that were recorded."""

from __future__ import annotations

from dataclasses import replace

from hapticd.config.loading import LoadedConfig
from hapticd.device import Sample
from hapticd.errors import ConfigError
from hapticd.tick.assemble import make_tick
from hapticd_views.replay.scores import Trace
from hapticd_views.replay.stretch import Stretch


def replay_motion(stretch: Stretch, config: LoadedConfig) -> Trace:
    """What a law would have done while the device moved as it did.

    The device goes on moving as it was recorded, whatever the law's force: this judges the law, not the loop. Under the
    law and configuration of the recording the forces are the recorded ones to the last bit, as far as the law had
    learned nothing before, and on a real device outside of ramps, which go by a clock that is not recorded.

    Args:
        stretch: what was recorded.
        config: with the law, its parameters, the walls and the limits.

    Raises:
        ConfigError: it does not fit the device.
    """
    # Time and news of the device as the loop has seen them.
    info = replace(stretch.info, has_clock=False, has_sequence=True, has_velocity=True)
    tick = make_tick(config, info)
    if not tick.contacts:
        raise ConfigError(f"{config.path}: has no wall to replay against")
    ticks = stretch.ticks
    positions, velocities = ticks["position_m"].tolist(), ticks["velocity_m_per_s"].tolist()
    wall, found = tick.contacts[0].wall, Trace(config.config.controller.law)
    ledgers = [contact.ledger for contact in tick.contacts]
    sample = Sample(len(info.axes))
    sample.position_m = positions[0]
    sample.sequence = 0
    tick.start(sample)
    tick.arm()
    for at, dt_s in enumerate(ticks["dt_s"].tolist()):
        sample.position_m = positions[at]
        sample.velocity_m_per_s = velocities[at]
        sample.sequence += dt_s > 0.0
        tick.step(sample, dt_s)
        if tick.fault:
            found.fault = found.fault or f"tick {at}: {tick.fault_text}"
            tick.fault = 0
        first = tick.contacts[0]
        found.x_m.append(first.x_m)
        found.force_n.append(wall.outward * tick.force_n[wall.axis])
        found.force_requested_n.append(wall.outward * tick.requested_n[wall.axis])
        found.energy_j.append(sum([ledger.energy_j for ledger in ledgers]))
        found.damping_n_s_per_m.append(first.damping_n_s_per_m)
        found.in_contact.append(first.in_contact)
    found.generated_j = sum([ledger.generated_j for ledger in ledgers])
    found.dissipated_j = sum([ledger.dissipated_j for ledger in ledgers])
    return found
