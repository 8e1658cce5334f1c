"""What the client of a spring has asked for: less than the file says, never more."""

from __future__ import annotations

from math import inf

from hapticd.tick.remote.update import DAMPING, STIFFNESS, Update


class AskedSpring:
    """Stiffness and damping that a client has asked for."""

    __slots__ = ("_damping", "_stiffness")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Go by the file again."""
        self._stiffness = self._damping = inf

    def hear(self, update: Update) -> None:
        """Take over what a client has said; what it has not said is as the file has it."""
        self._stiffness = max(update.stiffness_n_per_m, 0.0) if update.said & STIFFNESS else inf
        self._damping = max(update.damping_n_s_per_m, 0.0) if update.said & DAMPING else inf

    def within(self, stiffness_n_per_m: float, damping_n_s_per_m: float) -> tuple[float, float]:
        """What to go by [N/m, N s/m].

        Args:
            stiffness_n_per_m: of the file, the largest.
            damping_n_s_per_m: of the file; a negative one is the file's to say, and no client's.
        """
        if self._damping < inf:
            damping_n_s_per_m = min(self._damping, max(0.0, damping_n_s_per_m))
        return min(self._stiffness, stiffness_n_per_m), damping_n_s_per_m
