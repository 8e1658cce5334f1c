"""The reference that laws are held to: a recorded press, and what every law answers to its motion.

    python -m tests.views.replay.reference

makes both anew. The difference of the table in the version control is what has changed; say in the commit why.
"""

from __future__ import annotations

from pathlib import Path

from hapticd.config.loading import LoadedConfig, load
from hapticd_views.replay.replay import replay
from hapticd_views.replay.scores import table
from tests.views.replay.simulated import record

FOLDER = Path(__file__).parent
PRESS = FOLDER / "press.mcap"
TABLE = FOLDER / "press.txt"
LAWS = (
    "none", "ring-damping", "energy-cycle", "tdpa", "damper", "virtual-coupling", "energy-bounding", "input-to-state",
    "set-position",
)  # fmt: skip
TICKS = 700
DIGITS = 9

TEXT = """
[device.options]
model = "omega7"
initial_position_m = 0.0005
hand.force = { profile = "press-and-release", newton = -3.0, release_newton = 1.0, period_s = 0.35 }

[[scene.walls]]
stiffness_n_per_m = 9000.0

[controller]
law = "none"
"""


def configuration() -> LoadedConfig:
    """What was pressed."""
    return load(TEXT)


def lines(file: Path) -> list[str]:
    """What every law answers to a recorded motion."""
    return table(replay(file, laws=LAWS, hand="motion").scores, DIGITS)


if __name__ == "__main__":
    record(PRESS, configuration(), TICKS)
    TABLE.write_text("\n".join(lines(PRESS)) + "\n")
