"""Whether a refusal was due: it names a parameter, its value and a limit, and the value is beyond the limit."""

from __future__ import annotations

import math
import re

from hapticd.simulation.plant.coefficients import MOST_GROWTH, MOST_TURNS
from hapticd_studies.extremes.case import LoopCase

_NUMBER = r"(-?[\d.]+(?:e[+-]?\d+)?)"
_AT_LEAST = re.compile(rf"greater than or equal to {_NUMBER}|must be {_NUMBER} or more")
_AT_MOST = re.compile(rf"less than or equal to {_NUMBER}|must be at most {_NUMBER}")


def is_due(place: LoopCase, text: str) -> bool:
    """Whether a place is beyond the limit that a refusal names.

    Where the limit depends on mass and rate, it must also be the one that those lead to.
    """
    name = text.partition(" = ")[0]
    value = getattr(place, name.replace("hand.stiffness", "hand_stiffness"), None)
    if not isinstance(value, int | float):
        return False
    if found := _AT_LEAST.search(text):
        grows = -place.viscous_n_s_per_m / place.mass_kg * place.period_s
        return value < float(found[1] or found[2]) * (1.0 - 1e-5) and (found[2] is None or grows > MOST_GROWTH)
    if found := _AT_MOST.search(text):
        turns = math.sqrt(place.hand_stiffness_n_per_m / place.mass_kg) * place.period_s / (2.0 * math.pi)
        return value > float(found[1] or found[2]) * (1.0 - 1e-5) and (found[2] is None or turns > MOST_TURNS)
    return False
