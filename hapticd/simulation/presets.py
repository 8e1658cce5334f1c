"""Named device models. Each is a model and not a fact about hardware: no maker publishes these dynamics."""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # Calibrated so that without a law, at 1 kHz, it stays within 0.2 mm at 8 kN/m and oscillates from 9 kN/m on when it
    # arrives with some motion, as the paper reports of the real device; within 0.05 mm it rests up to 7 kN/m.
    "omega7": {
        "mass_kg": 0.25,
        "viscous_n_s_per_m": 4.4,
        "coulomb_n": 0.0,
        "resolution_m": 1e-5,
        "max_force_n": 12.0,
    },
    # The paper's own simulations: a bare mass with nothing that dissipates.
    "paper-simulation": {
        "mass_kg": 0.5,
        "viscous_n_s_per_m": 0.0,
        "coulomb_n": 0.0,
        "resolution_m": 0.0,
        "max_force_n": 0.0,
    },
    # A one-axis rig on a friction drive: light, coarse, with friction that shows.
    "hapkit": {
        "mass_kg": 0.08,
        "viscous_n_s_per_m": 0.5,
        "coulomb_n": 0.1,
        "resolution_m": 2e-5,
        "max_force_n": 5.0,
    },
    # A geared game controller: heavy for its force, and rough.
    "falcon": {
        "mass_kg": 0.5,
        "viscous_n_s_per_m": 3.0,
        "coulomb_n": 0.5,
        "resolution_m": 6e-5,
        "max_force_n": 9.0,
    },
}
"""What `model = "..."` stands for; a key that the file sets itself wins."""
