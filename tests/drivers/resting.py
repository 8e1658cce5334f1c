"""Whether a wall of a whole daemon is still, from the positions that it publishes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from tests.daemon.running import Subscriber

HALF_SECOND = 500
"""Ticks that a handle has to rest for."""

DISTURBANCES = ("unsent_commands", "ticks_without_state")
"""What a driver counts where this computer had no time for the link: each sets a handle at a wall swinging."""

_LOOK_EVERY = 25


class DisturbedError(Exception):
    """The loop let go: this computer had no time for it, or for the device's double.

    Args:
        text: of the fault.
        code: of it; None where it was told before anyone listened.
    """

    def __init__(self, text: str, code: int | None = None) -> None:
        super().__init__(text)
        self.code = code


@dataclass(frozen=True)
class Rest:
    """The half second in which the handle moved least.

    Attributes:
        swing_m: how far it moved to and fro.
        mean_m: where it was.
        disturbed: what kept it from rest, besides a law; empty where it rested, or where nothing did.
    """

    swing_m: float
    mean_m: float
    disturbed: str = ""


def calmest(endpoint: str, ticks: int, still_m: float) -> Rest:
    """The calmest half second of some ticks; the first that is still ends the looking.

    Args:
        endpoint: of the daemon's telemetry.
        ticks: how many.
        still_m: a swing below this is rest [m].

    Raises:
        DisturbedError: a fault came, so that the wall did not push all the time.
    """
    with Subscriber(endpoint, "hapticd/position", "hapticd/event", "hapticd/status") as subscriber:
        before = _armed(subscriber)
        best = _calmest(subscriber, ticks, still_m)
        after = _armed(subscriber)
    return replace(best, disturbed="" if best.swing_m < still_m else _grown(before, after))


def _calmest(subscriber: Subscriber, ticks: int, still_m: float) -> Rest:
    window: deque[float] = deque(maxlen=HALF_SECOND)
    best = Rest(float("inf"), 0.0)
    seen = 0
    for topic, fields in subscriber.maps():
        if topic == "hapticd/event" and 200 <= fields["code"] < 300:
            raise DisturbedError(str(fields["text"]), fields["code"])
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


def _armed(subscriber: Subscriber) -> dict[str, float]:
    """What the device counts, of a daemon that is armed: a fault before may have been told before anyone listened."""
    status = subscriber.until("hapticd/status")
    if not status["armed"]:
        raise DisturbedError("disarmed")
    metrics: dict[str, float] = status["device_metrics"]
    return metrics


def _grown(before: dict[str, float], after: dict[str, float]) -> str:
    counted = [name for name in DISTURBANCES if name in after]
    return ", ".join(f"{name}: {before[name]} to {after[name]}" for name in counted if after[name] > before[name])
