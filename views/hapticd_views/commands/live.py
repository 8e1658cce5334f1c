"""A daemon that is listened to for a while, until Ctrl-C at most."""

from __future__ import annotations

import time
from pathlib import Path

from hapticd.client import connect as connected
from hapticd.progress import progress_bar
from hapticd_views.recording.recorder import MOST_UNREAD
from hapticd_views.source import Source, listen


def heard(duration_s: float, instance: str, connect: str | None, control: str | None, keys: Path | None) -> Source:
    """What a daemon does from now on.

    Args:
        duration_s: how long [s].
        instance: of this computer, when no endpoint is given.
        connect: its `telemetry.tcp` elsewhere.
        control: its `control.tcp` there.
        keys: key file for it.
    """
    began_s = time.monotonic()
    with (
        connected(instance, telemetry=connect, control=control, keys=keys, receive_high_water=MOST_UNREAD) as daemon,
        progress_bar(round(duration_s), "listening") as tell,
    ):

        def stopped() -> bool:
            tell(completed=time.monotonic() - began_s)
            return False

        return listen(daemon, duration_s, stopped)
