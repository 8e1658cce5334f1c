"""A recording of a simulated run, made without a daemon: the same ticks, and so the same bytes every time."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig
from hapticd.offline.rehearsal import Rehearsal
from hapticd.telemetry.records import Damping, Energy, Position, Status, Timing
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt

BEGAN_S = 1_700_000_000.0
CHUNK_TICKS = 400


def record(path: Path, config: LoadedConfig, ticks: int, skip: tuple[int, int] = (0, 0), **status: Any) -> None:
    """Run a configuration and record it.

    Args:
        path: of the recording.
        config: of a simulated device.
        ticks: how many.
        skip: from which tick up to which one nothing arrives.
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
        if skip[0] <= seq < skip[1]:
            continue
        at = BEGAN_S + seq * rehearsal.period_s
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
            Timing(at, seq, seq * config.config.loop.period_ns, 0.0, 0.0, motion.dt_s),
        ):
            file.add(one, at)
        if seq % CHUNK_TICKS == CHUNK_TICKS - 1:
            file.commit()
    file.close()
