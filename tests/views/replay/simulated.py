"""A recording of a simulated run, made without a daemon: the same ticks, and so the same bytes every time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.offline.rehearsal import Rehearsal
from hapticd.telemetry.records import Damping, Energy, Event, Position, Sent, Status, Timing
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt

BEGAN_S = 1_700_000_000.0
CHUNK_TICKS = 400


ORDERS = {"disarm": EventCode.DISARMED, "tare": EventCode.TARED, "arm": EventCode.ARMED}


def record(
    path: Path,
    config: LoadedConfig,
    ticks: int,
    skip: tuple[int, int] = (0, 0),
    orders: Mapping[int, str] = MappingProxyType({}),
    told_every: int = 0,
    more: Sequence[Sent] = (),
    pause: tuple[int, float] = (0, 0.0),
    **status: Any,
) -> None:
    """Run a configuration and record it.

    Args:
        path: of the recording.
        config: of a simulated device.
        ticks: how many.
        skip: from which tick up to which one nothing arrives.
        orders: what is asked for behind a tick, one of `ORDERS`; its event is recorded.
        told_every: a status comes in every so many ticks; 0: none does.
        more: what else is recorded, behind the ticks.
        pause: which tick comes so much later than right after the one before [s].
        status: what the receipt says otherwise.
    """
    rehearsal = Rehearsal(config)
    tick = rehearsal.tick
    walls = config.config.scene.walls
    told = Status(
        timestamp=BEGAN_S,
        version="0",
        rate_hz=config.config.loop.rate_hz,
        law=config.config.controller.law,
        driver=config.config.device.driver,
        device=tick.info.model,
        simulated=True,
        axes=tick.info.axes,
        wall_axis=tuple(wall.axis for wall in walls),
        wall_position_m=tuple(wall.position_m for wall in walls),
        wall_stiffness_n_per_m=tuple(wall.stiffness_n_per_m for wall in walls),
        config_file=config.path.name,
        config_hash=config.hash,
    )
    answer = {
        **told.as_map(),
        "config_text": config.text,
        "device_info": asdict(tick.info),
        "kernel": "none",
        "machine": "none",
        "python": "any",
        **status,
    }
    receipt = make_receipt(told, answer) | {"recorder_version": "test"} | status
    file = RecordingFile(path, overwrite=True)
    file.describe(METADATA, as_texts(receipt))
    for seq in rehearsal.run(ticks):
        order = orders.get(seq, "")
        armed = tick.guard.mode is Mode.ARMED
        if order:
            obey(rehearsal, order)
        if skip[0] <= seq < skip[1]:
            continue
        late_s = pause[1] if seq >= pause[0] else 0.0
        at = BEGAN_S + seq * rehearsal.period_s + late_s
        if told_every and seq % told_every == 0:
            stiffness = tuple(contact.wall.stiffness_n_per_m for contact in tick.contacts)
            file.add(
                replace(told, timestamp=at, seq=seq, ticks=seq + 1, armed=armed, wall_stiffness_n_per_m=stiffness), at
            )
        if order:
            file.add(Event(at, seq, ORDERS[order], order), at)
        ledgers = [contact.ledger for contact in tick.contacts]
        motion = tick.motion
        for one in (
            Position(
                at,
                seq,
                tuple(motion.position_m),
                tuple(motion.velocity_m_per_s),
                tuple(tick.force_n),
                tuple(tick.requested_n),
            ),
            Energy(
                at,
                seq,
                sum([ledger.energy_j for ledger in ledgers]),
                0.0,
                sum([ledger.dissipated_j for ledger in ledgers]),
                sum([ledger.generated_j for ledger in ledgers]),
            ),
            Damping(
                at,
                seq,
                tuple(contact.damping_n_s_per_m for contact in tick.contacts),
                tuple(contact.in_contact for contact in tick.contacts),
                tuple(contact.felt_mass_kg for contact in tick.contacts),
            ),
            Timing(at, seq, seq * config.config.loop.period_ns + round(late_s * 1e9), 0.0, 0.0, motion.dt_s),
        ):
            file.add(one, at)
        if seq % CHUNK_TICKS == CHUNK_TICKS - 1:
            file.commit()
    for each in more:
        file.add(each, each.timestamp)
    file.close()


def obey(rehearsal: Rehearsal, order: str) -> None:
    """Do between two ticks what the loop does when it is asked for it."""
    tick = rehearsal.tick
    if order == "disarm":
        tick.release()
    elif order == "tare":
        assert tick.tare()
    else:
        rehearsal._driver.enable()
        assert tick.arm()
