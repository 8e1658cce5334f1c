"""How many examples a property is tried on: as many as it says, or `EXAMPLES` times that, as the nightly run has it."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import settings

TIMES = int(os.environ.get("EXAMPLES", "1"))


def examples(count: int, **more: Any) -> settings:
    """Hypothesis's settings for so many examples, and whatever else they shall say."""
    return settings(max_examples=count * TIMES, **more)
