"""Energy between a device and a wall: the books of every tick, and where one press and release ends.

Sign: energy that flows into the wall is positive, E(n) = E(n-1) - F(n-1) (x(n) - x(n-1)), which is exact because a
zero-order hold keeps F(n-1) until sample n. Where ticks without a sample change the force, F(n-1) is its mean over that
time. E falls below zero when the wall has given back more than it took.
"""

from __future__ import annotations

from typing import Any


class CycleFields:
    """The scalar fields that `cycle_ended` keeps; a law's State inherits them to run its own detector."""

    window_energy_j: float  # E of the last sample that differed from the one before
    window_minimum_j: float  # E at the candidate; E(T_n) once the cycle has ended
    window_falls: int  # strict falls in a row up to the candidate
    window_rises: int  # strict rises in a row since the candidate


def cycle_ended(state: Any, energy_j: float, in_contact: bool, past: int, future: int) -> bool:
    """Whether a press and release has just been completed: the time window of eq. (10).

        ... E(t-2) > E(t-1) > E(t) < E(t+1) < E(t+2) ...      `past` strict falls, then `future` strict rises

    Equal samples are skipped: with a quantised position E often repeats, and a literal reading would then see no
    cycle at all. A lost contact ends the cycle at once, since E stays flat outside the wall: the rises that are still
    to come then never do, and a damper that pulls in the last sample inside has often made the first of them.

    Args:
        state: an object with the fields of `CycleFields`.
        energy_j: E now [J].
        in_contact: whether the device is inside the wall now.
        past: falls that must come before the minimum.
        future: rises that must follow it; the verdict is that many samples late.

    Returns:
        True once per cycle; `state.window_minimum_j` is then the energy at its end.
    """
    ended = False
    if energy_j < state.window_energy_j:
        if state.window_rises > 0:
            state.window_falls = 0
            state.window_rises = 0
        state.window_falls += 1
        state.window_energy_j = energy_j
    elif energy_j > state.window_energy_j:
        if state.window_rises == 0:
            state.window_minimum_j = state.window_energy_j
        state.window_rises += 1
        if state.window_falls >= past and state.window_rises == future:
            ended = True
        state.window_energy_j = energy_j
    if not in_contact:
        if state.window_falls >= past and state.window_rises < future:
            if state.window_rises == 0:
                state.window_minimum_j = state.window_energy_j
            ended = True
        state.window_falls = 0
        state.window_rises = 0
    return ended


class EnergyLedger:
    """The books of one contact, kept for every law alike.

        energy = stored in the spring + dissipated - generated          (eq. 6)

    The generated part is counted by itself, tick by tick, as what the spring gave beyond what it had stored:

        dG = U(n) - U(n-1) + F_spring(n-1) (x(n) - x(n-1))

    For a convex U this is never negative; for a linear spring it is k dx^2 / 2. It is negative only where stored
    energy vanishes without coming back, for example when a ramp lets a pressed wall go: that counts as dissipated.

    Attributes:
        energy_j: energy into the contact with the applied force [J].
        stored_j: energy in the spring now [J].
        dissipated_j: energy taken by wall damping, law and ramps [J]; falls while they are active.
        generated_j: energy made by sampling and hold [J], never falls.
        debt_j: what this contact has given since it was touched beyond what it took, and held when armed [J], >= 0.
        cycle: completed cycles, by the 2+2 window whatever the law uses.
        cycle_energy_j, cycle_generated_j, cycle_damping_n_s_per_m: of the last completed cycle.
        cycle_duration_s: how long it took, from the touch or the end of the cycle before [s].
    """

    __slots__ = (
        "_cycle_s",
        "_since_j",
        "_touch_j",
        "cycle",
        "cycle_damping_n_s_per_m",
        "cycle_duration_s",
        "cycle_energy_j",
        "cycle_generated_j",
        "dissipated_j",
        "energy_j",
        "generated_j",
        "stored_j",
        "window_energy_j",
        "window_falls",
        "window_minimum_j",
        "window_rises",
    )

    def __init__(self) -> None:
        self.energy_j = 0.0
        self.stored_j = 0.0
        self.dissipated_j = 0.0
        self.generated_j = 0.0
        self.cycle = 0
        self.cycle_energy_j = 0.0
        self.cycle_generated_j = 0.0
        self.cycle_damping_n_s_per_m = 0.0
        self.cycle_duration_s = 0.0
        self._cycle_s = 0.0
        self._touch_j = 0.0
        self._since_j = 0.0  # energy since the last cycle ended: small, so that no rise or fall drowns in a large sum
        self.window_energy_j = 0.0
        self.window_minimum_j = 0.0
        self.window_falls = 0
        self.window_rises = 0

    @property
    def debt_j(self) -> float:
        """What this contact has given since it was touched beyond what it took, and held when armed [J], >= 0."""
        return max(0.0, -self._touch_j)

    def arm(self, stored_j: float) -> None:
        """Take what a spring holds that is pressed when forces are let in: no hand gave it, and its return is no debt.

        Args:
            stored_j: energy in the spring once its force is there [J].
        """
        self._touch_j = min(self._touch_j - self.stored_j, 0.0) + stored_j

    def update(
        self,
        moved_m: float,
        applied_n: float,
        applied_spring_n: float,
        stored_j: float,
        in_contact: bool,
        damping_n_s_per_m: float,
        dt_s: float,
    ) -> None:
        """Enter one tick.

        Args:
            moved_m: x(n) - x(n-1) [m].
            applied_n: F(n-1), applied from sample n-1 to sample n, on the mean [N].
            applied_spring_n: the spring's part of it [N].
            stored_j: energy in the spring at x(n) [J].
            in_contact: whether x(n) is inside the wall.
            damping_n_s_per_m: damping of the law now, entered with a completed cycle [N s/m].
            dt_s: time since the last sample [s].
        """
        taken_j = -applied_n * moved_m
        spring_j = -applied_spring_n * moved_m
        made_j = stored_j - self.stored_j - spring_j
        self.stored_j = stored_j
        self.energy_j += taken_j
        if made_j >= 0.0:
            self.generated_j += made_j
            self.dissipated_j += taken_j - spring_j
        else:
            self.dissipated_j += taken_j - spring_j - made_j
        self._since_j += taken_j
        self._touch_j = self._touch_j + taken_j if in_contact or applied_n != 0.0 else 0.0
        self._cycle_s += dt_s
        if cycle_ended(self, self._since_j, in_contact, 2, 2):
            end_j = self.window_minimum_j
            self._since_j -= end_j
            self.window_energy_j -= end_j
            self.cycle += 1
            self.cycle_energy_j = self.energy_j - self._since_j
            self.cycle_generated_j = -end_j
            self.cycle_damping_n_s_per_m = damping_n_s_per_m
            self.cycle_duration_s = self._cycle_s
            self._cycle_s = 0.0
        elif not in_contact:
            self._cycle_s = 0.0

    def absorb(self, other: EnergyLedger) -> None:
        """Add the totals of a contact that is gone, so that sums over all contacts do not jump."""
        self.energy_j += other.energy_j
        self.stored_j += other.stored_j
        self.dissipated_j += other.dissipated_j
        self.generated_j += other.generated_j
