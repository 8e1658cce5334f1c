"""What is summed over one energy cycle, by every law that turns cycles into damping."""

from __future__ import annotations

from typing import Any

from hapticd.tick.energy import CycleFields


class CycleSums(CycleFields):
    """The scalar fields that these functions keep; a law's State inherits them."""

    energy_j: float  # into the contact since the end of the last cycle
    motion_m2_per_s: float  # sum of v^2 dt in contact
    candidate_motion_m2_per_s: float  # the same at the detector's candidate
    candidate_stored_j: float  # what the spring held at the candidate
    stored_j: float  # what the spring held at the end of the last cycle
    lowest_m: float  # deepest position since the end of the last cycle
    highest_m: float  # highest position in contact since then


def begin(state: Any, energy_j: float) -> None:
    """Count energy and motion from here; how far it has travelled goes on.

    Args:
        state: an object with the fields of `CycleSums`.
        energy_j: what is owed from before [J].
    """
    state.energy_j = energy_j
    state.window_energy_j = energy_j
    state.window_minimum_j = 0.0
    state.window_falls = 0
    state.window_rises = 0
    state.motion_m2_per_s = 0.0
    state.candidate_motion_m2_per_s = 0.0
    state.candidate_stored_j = 0.0
    state.stored_j = 0.0


def end(state: Any, x_m: float) -> None:
    """A cycle has ended at the candidate: energies and travel count from there, so that they stay small.

    Args:
        state: an object with the fields of `CycleSums`.
        x_m: where the device is now [m].
    """
    state.energy_j -= state.window_minimum_j
    state.window_energy_j -= state.window_minimum_j
    state.window_minimum_j = 0.0
    state.stored_j = state.candidate_stored_j
    state.lowest_m = x_m
    state.highest_m = x_m
