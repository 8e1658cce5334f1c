"""Energy between a device and a wall: the books of every tick, and where one press and release ends.

Sign: energy that flows into the wall is positive, E(n) = E(n-1) - F(n-1) (x(n) - x(n-1)), which is exact because a
zero-order hold keeps F(n-1) until sample n. E falls below zero when the wall has given back more than it took.
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
    cycle at all. A lost contact ends the cycle at once, since E stays flat outside the wall and never rises again.

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
        if state.window_falls >= past and state.window_rises == 0:
            state.window_minimum_j = state.window_energy_j
            ended = True
        state.window_falls = 0
        state.window_rises = 0
    return ended
