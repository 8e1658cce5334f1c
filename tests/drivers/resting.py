"""Whether a wall of a whole daemon is still, from the positions that it publishes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from tests.daemon.running import Subscriber

HALF_SECOND = 500
"""Ticks that a handle has to rest for."""

_LOOK_EVERY = 25


class DisturbedError(Exception):
    """The loop let go: this computer had no time for it, or for the device's double."""


@dataclass(frozen=True)
class Rest:
    """The half second in which the handle moved least.

    Attributes:
        swing_m: how far it moved to and fro.
        mean_m: where it was.
    """

    swing_m: float
    mean_m: float


def calmest(endpoint: str, ticks: int, still_m: float) -> Rest:
    """The calmest half second of some ticks; the first that is still ends the looking.

    Args:
        endpoint: of the daemon's telemetry.
        ticks: how many.
        still_m: a swing below this is rest [m].

    Raises:
        DisturbedError: a fault came, so that the wall did not push all the time.
    """
    window: deque[float] = deque(maxlen=HALF_SECOND)
    best = Rest(float("inf"), 0.0)
    with Subscriber(endpoint, "hapticd/position", "hapticd/event", "hapticd/status") as subscriber:
        if not subscriber.until("hapticd/status")["armed"]:
            raise DisturbedError("disarmed before")
        seen = 0
        for topic, fields in subscriber.maps():
            if topic == "hapticd/event" and 200 <= fields["code"] < 300:
                raise DisturbedError(str(fields["text"]))
            if topic != "hapticd/position":
                continue
            window.append(fields["position_m"][0])
            seen += 1
            if len(window) == HALF_SECOND and seen % _LOOK_EVERY == 0:
                found = Rest(max(window) - min(window), sum(window) / HALF_SECOND)
                best = min(best, found, key=lambda rest: rest.swing_m)
                if best.swing_m < still_m or seen >= ticks:
                    return best
    raise AssertionError("no ticks any more")
