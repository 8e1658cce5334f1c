"""What clients are told of what was refused: the first at once, and then the last of each second.

A refusal within a second of one that was told waits until that second is over. So every client hears what is wrong,
and one that keeps making mistakes gets one answer a second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

QUIET_NS = 1_000_000_000
"""Time between two answers to a client [ns]."""

_MOST_REMEMBERED = 512  # clients


class Refusal(NamedTuple):
    """A message that was not taken.

    Attributes:
        name: of what it was for, "" when it named nothing.
        text: why not.
        key: of the message that is wrong, "" where it is none by itself.
        passing: whether it holds only until the client may have the name.
    """

    name: str
    text: str
    key: str = ""
    passing: bool = False


class Refusals:
    """Answers clients, each once a second at most.

    Args:
        tell: sends a client a refusal.
    """

    def __init__(self, tell: Callable[[bytes, Refusal], None]) -> None:
        self._tell = tell
        self._told_ns: dict[bytes, int] = {}  # the oldest first
        self._waiting: dict[bytes, Refusal] = {}

    def add(self, identity: bytes, refusal: Refusal, now_ns: int) -> None:
        """Tell a client of a refusal, now or when its second is over."""
        if now_ns - self._told_ns.get(identity, now_ns - QUIET_NS) < QUIET_NS:
            self._waiting[identity] = refusal
            return
        self._waiting.pop(identity, None)
        self._told_ns.pop(identity, None)
        self._told_ns[identity] = now_ns
        if len(self._told_ns) > _MOST_REMEMBERED:
            oldest = next(iter(self._told_ns))
            del self._told_ns[oldest]
            self._waiting.pop(oldest, None)
        self._tell(identity, refusal)

    def taken(self, identity: bytes, name: str) -> None:
        """A message of a client for a name was taken: that the name is another one's is not true any more."""
        waiting = self._waiting.get(identity)
        if waiting is not None and waiting.passing and waiting.name == name:
            del self._waiting[identity]

    def turn(self, now_ns: int) -> None:
        """Tell what has waited for long enough."""
        for identity in [one for one in self._waiting if now_ns - self._told_ns[one] >= QUIET_NS]:
            self.add(identity, self._waiting[identity], now_ns)
