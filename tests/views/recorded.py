"""A recording of a run that was simulated: what its recorder would have written, with anything else put in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hapticd.offline.run import Run
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Position, Status, Timing
from hapticd_views.recording.file import RecordingFile
from hapticd_views.recording.messages import Note, RecordedGap
from hapticd_views.recording.receipt import METADATA, as_texts, make_receipt

EPOCH_S = 1_700_000_000.0


def write_recording(
    path: Path,
    run: Run,
    text: str,
    more: Sequence[Event | Note | RecordedGap | Status] = (),
    left_out: range = range(0),
    late_us: Sequence[float] = (),
    skipped: Mapping[int, int] = MappingProxyType({}),
    receipt: dict[str, Any] | None = None,
    later: Sequence[dict[str, Any]] = (),
) -> Path:
    """Write it.

    Args:
        path: where.
        run: every tick of it.
        text: its configuration.
        more: what else is in it, in order of time, after the ticks.
        left_out: ticks that did not arrive.
        late_us: how late each tick was; 10 us where not given.
        skipped: deadlines that were skipped, by the tick before them.
        receipt: what the receipt says otherwise.
        later: what the receipts of reloads say otherwise, their timestamps at least.
    """
    wall = run.config.scene.walls[0]
    status = Status(
        timestamp=EPOCH_S,
        instance="default",
        rate_hz=1.0 / run.period_s,
        law=run.config.controller.law,
        driver="loopback",
        device="omega7",
        simulated=True,
        axes=("z",),
        wall_axis=(wall.axis,),
        wall_position_m=(wall.position_m,),
        wall_stiffness_n_per_m=(run.stiffness_n_per_m,),
        version="0.2.0",
    )
    file = RecordingFile(path, overwrite=True)
    told = make_receipt(status, {"config_text": text, "config_file": "/etc/lab.toml", "kernel": "6.1.0"})
    file.describe(METADATA, as_texts({**told, **(receipt or {})}))
    outward = 1.0 if wall.free_side == "positive" else -1.0
    columns = {name: column.tolist() for name, column in run.columns.items()}
    cycle = columns["cycle"][0]
    missed = 0
    for seq in range(run.ticks):
        missed += skipped.get(seq - 1, 0)
        if seq in left_out:
            continue
        at_s = EPOCH_S + columns["t_s"][seq] + missed * run.period_s
        deadline_ns = (seq + missed) * 1_000_000
        position_m = wall.position_m + outward * columns["x_measured_m"][seq]
        force_n, asked_n = outward * columns["force_n"][seq], outward * columns["force_requested_n"][seq]
        share = seq / run.ticks
        records: list[Any] = [
            Position(at_s, seq, (position_m,), (outward * columns["v_m_per_s"][seq],), (force_n,), (asked_n,)),
            Energy(at_s, seq, columns["energy_j"][seq], 0.0, run.dissipated_j * share, run.generated_j * share),
            Damping(at_s, seq, (columns["damping_n_s_per_m"][seq],), (bool(columns["in_contact"][seq]),), (0.0,)),
            Timing(at_s, seq, deadline_ns, late_us[seq] if len(late_us) else 10.0, 20.0, run.period_s),
        ]
        if columns["cycle"][seq] != cycle:
            cycle = columns["cycle"][seq]
            records.append(Cycle(at_s, seq, 0, cycle, columns["energy_j"][seq], 1e-5, 0.0, 0.03))
        for record in records:
            file.add(record, at_s)
    for changed in later:
        file.describe(METADATA, as_texts({**told, **changed}))
    for one in more:
        file.add(one, one.timestamp)
    file.close()
    return path
