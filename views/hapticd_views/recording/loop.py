"""What a recording tells of the loop in each of its ticks: which one it was, and whether it let forces through."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from hapticd.tick.event import EventCode
from hapticd_views.recording.columns import Values

Table = dict[str, Values]

FAULTS = range(200, 300)
"""Codes of the events that take the force away."""

_STATUS = -1  # its place among the events of a tick: it comes before them


def loop_numbers(ticks: Table, topics: Mapping[str, Table]) -> npt.NDArray[np.int64]:
    """Which loop each tick is of, from 0: a daemon that is started anew begins one, and so does a device that is found.

    Books, cycles and deadlines begin anew with each.

    Args:
        ticks: of the recording.
        topics: of the recording.
    """
    run, seq = ticks["run"], ticks["seq"]
    begins = np.diff(run, prepend=run[:1]) != 0
    event = topics.get("event", {"code": [], "run": [], "seq": []})
    for code, its, at in zip(event["code"], event["run"], event["seq"], strict=True):
        if code == EventCode.STARTED:
            begins |= (run == its) & (seq >= at) & (np.roll(seq, 1) < at)
    begins[:1] = False
    return np.asarray(np.cumsum(begins), np.int64)


def armed(ticks: Table, topics: Mapping[str, Table]) -> npt.NDArray[np.bool_]:
    """Whether forces were let through, tick by tick; where nothing tells of it, they are taken to have been.

    Not so from the tick on in which a fault or a disarming began to let the force out: what a wall does by then is no
    longer its own.

    Args:
        ticks: of the recording.
        topics: of the recording.
    """
    found = np.ones(len(ticks["seq"]), np.bool_)
    for run in np.unique(ticks["run"]).tolist():
        own = ticks["run"] == run
        known = sorted([*_of_events(topics, run), *_of_statuses(topics, run)])
        if known:
            since = np.array([seq for seq, _, _ in known])
            states = np.array([_before(known), *(state for _, _, state in known)])
            found[own] = states[np.searchsorted(since, ticks["seq"][own], side="right")]
    return found


def seqs_of(status: Table) -> npt.NDArray[np.int64]:
    """The tick that was the newest when each status was made.

    A new subscriber gets the last one again, as it was but with the `seq` of then: by the ticks it counts it is older.
    """
    if "ticks" not in status or "ring_drops" not in status:
        return np.asarray(status["seq"], np.int64)
    counted = status["ticks"] + status["ring_drops"]
    made = np.where(counted > 0, np.minimum(status["seq"], counted - 1), status["seq"])
    return np.asarray(made, np.int64)


def _before(known: list[tuple[int, int, bool]]) -> bool:
    """What was before the first thing that is known: a status holds for the ticks before it, an event ends it."""
    _, order, state = known[0]
    return state if order == _STATUS else not state


def _of_events(topics: Mapping[str, Table], run: int) -> list[tuple[int, int, bool]]:
    """From which tick on each event changed it, its place among them, and to what."""
    event = topics.get("event")
    if event is None:
        return []
    rows = [
        (int(code), int(seq))
        for code, seq, its in zip(event["code"], event["seq"], event["run"], strict=True)
        if its == run
    ]
    began = {seq for code, seq in rows if code == EventCode.STARTED}
    known = []
    for order, (code, seq) in enumerate(rows):
        if code == EventCode.STARTED or code in FAULTS:
            known.append((seq, order, False))
        elif code == EventCode.DISARMED:
            known.append((seq + 1, order, False))
        elif code == EventCode.ARMED:  # on request behind its tick, by itself before the first one
            known.append((seq if seq in began else seq + 1, order, True))
    return known


def _of_statuses(topics: Mapping[str, Table], run: int) -> list[tuple[int, int, bool]]:
    """The same of the statuses; one tells how the tick was that was the newest then."""
    status = topics.get("status", {})
    if "armed" not in status:
        return []
    rows = zip(seqs_of(status).tolist(), status["armed"].tolist(), status["run"].tolist(), strict=True)
    return [(seq, _STATUS, state) for seq, state, its in rows if its == run]
