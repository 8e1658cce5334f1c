"""In which ticks a client had a part in the force: a replay does not know what it said."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.errors import HapticdError
from hapticd_views.recording import Recording


def driven(recording: Recording) -> npt.NDArray[np.bool_]:
    """Whether a client drove anything, tick by tick, or what it had driven still faded out.

    Raises:
        HapticdError: the recording does not tell, or an object is where a client has moved it to.
    """
    _check(recording)
    ticks, found = recording.ticks, np.zeros(len(recording.ticks["seq"]), np.bool_)
    touch = recording.topics.get("contact", {})
    if "remote" not in touch:
        return found
    acts = touch["remote"] >= 0
    if "object" in touch:  # an object of which no client says anything stays where the scene has it
        acts &= (touch["object"] < 0) | (touch["remote_seq"] >= 0)
    for run in np.unique(ticks["run"]).tolist():
        own = ticks["run"] == run
        found[own] = np.isin(ticks["seq"][own], touch["seq"][acts & (touch["run"] == run)])
    return found


def _check(recording: Recording) -> None:
    status: dict[str, Any] = recording.topics.get("status", {})
    if "remote_messages" not in status or not status["remote_messages"].size:
        return
    said = status["remote_messages"]
    names, kinds = status["remote_name"], status["remote_kind"]
    for row, (name, kind) in enumerate(zip(names, kinds, strict=True)):
        moved = [each for each, what, count in zip(name, kind, said[row], strict=False) if what == "object" and count]
        if moved:
            raise HapticdError(f"{recording.path}: clients moved {moved[0]!r}, and a replay does not know where it is")
    if "contact" not in recording.topics and (any(map(any, status["remote_owner"])) or np.ptp(said, axis=0).any()):
        raise HapticdError(
            f"{recording.path}: has no topic 'contact', which tells when clients took part: a replay needs it"
        )
