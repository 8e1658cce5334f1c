"""What lies between a client and the daemon: a rate, a delay, jitter, losses, pauses; one seed makes all of it."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Network:
    """How late and how unevenly a client is heard.

    Attributes:
        rate_hz: how often it steps and sends [Hz].
        delay_s: of a message, each way [s].
        jitter_s: most that is added to that, each way; beyond a period messages overtake each other [s].
        loss: share of its messages that are lost.
        burst: how many are lost in a row, on average; 1: each by itself.
        pause_at_s: when it stands still, as a program that loads something [s].
        pause_s: for how long [s].
    """

    rate_hz: float
    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    burst: float = 1.0
    pause_at_s: float = 0.0
    pause_s: float = 0.0

    @property
    def late_s(self) -> float:
        """From a position to the force that answers it, on average, and without losses [s]."""
        return 2.0 * self.delay_s + self.jitter_s + 0.5 / self.rate_hz


@dataclass(frozen=True, slots=True)
class Turn:
    """One step of a client.

    Attributes:
        at_s: when it happens [s].
        sees_s: of which moment it knows the device's state [s].
        heard_s: when its message arrives; None: it is lost [s].
    """

    at_s: float
    sees_s: float
    heard_s: float | None


def turns(network: Network, duration_s: float, seed: int) -> Iterator[Turn]:
    """Every step of a client within a time."""
    draw = random.Random(seed)
    begins = network.loss / (network.burst * (1.0 - network.loss)) if network.loss < 1.0 else 1.0
    ends = 1.0 / network.burst
    losing = False
    sees_s = 0.0
    count = 0
    while (at_s := count / network.rate_hz) < duration_s:
        count += 1
        sees_s = max(sees_s, at_s - network.delay_s - draw.random() * network.jitter_s)  # a newer state is not unlearnt
        heard_s = at_s + network.delay_s + draw.random() * network.jitter_s
        losing = draw.random() >= ends if losing else draw.random() < begins
        if network.pause_at_s <= at_s < network.pause_at_s + network.pause_s:
            continue
        yield Turn(at_s, sees_s, None if losing else heard_s)
