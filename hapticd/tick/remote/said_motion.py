"""Which part of a motion a client says anew, and which it only repeats."""

from __future__ import annotations

_NEVER_NS = -1


class SaidMotion:
    """A place and a speed as a client has said them last: a repeated place is where something was, not where it is."""

    __slots__ = ("_place_ns", "_speed_ns")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Take whatever is said next for new."""
        self._place_ns = self._speed_ns = _NEVER_NS

    def hear(self, place_ns: int | None, speed_ns: int | None) -> tuple[bool, bool]:
        """Whether place and speed are others than at the last time.

        Args:
            place_ns: when the place was said, as an update has it; None: there is none [ns].
            speed_ns: the same of the speed [ns].
        """
        new = place_ns is not None and place_ns != self._place_ns, speed_ns is not None and speed_ns != self._speed_ns
        self._place_ns = _NEVER_NS if place_ns is None else place_ns
        self._speed_ns = _NEVER_NS if speed_ns is None else speed_ns
        return new
