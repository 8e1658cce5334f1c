"""What is measured: references, laws, configurations, numbers of walls, and the pieces of one tick."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass

from hapticd import plugins
from hapticd.config.walls import MAX_WALLS
from hapticd.paths import directory

RATE_HZ = 1000.0

BAR = 0.03
"""Largest share of the period that the body of a tick may take at 1 kHz, p99."""

WARM_TICKS = 60
"""First ticks of a block that are not counted: arming, first calls."""


@dataclass(frozen=True, slots=True)
class Case:
    """Something whose tick is measured.

    Attributes:
        group: "reference", "law", "config" or "walls".
        name: which one of the group.
        text: its configuration; empty for a reference, which has no tick.
        pieces: whether to take the time of the pieces as well, which makes the whole a little slower.
    """

    group: str
    name: str
    text: str = ""
    pieces: bool = False


def cases() -> list[Case]:
    """All that there is to measure: references, installed laws, shipped simulations, numbers of walls, pieces."""
    found = [Case("reference", name) for name in ("arithmetic", "empty loop", "memory in C")]
    found += [Case("law", name, scene(law=name)) for name in plugins.names(plugins.CONTROLLERS)]
    shapes = set()
    for path in sorted(directory("config").glob("*.toml")):
        text = path.read_text()
        if 'shape = "mesh"' in text:  # its field lies beside it, and a case is a text
            continue
        if (shape := _shape(text)) not in shapes and _is_simulated(text):
            shapes.add(shape)
            found.append(Case("config", path.name, text))
    found += [Case("walls", str(walls), scene(walls=walls)) for walls in (0, 1, 2, MAX_WALLS)]
    return [*found, Case("pieces", "energy-cycle", scene(), pieces=True)]


def scene(law: str = "energy-cycle", walls: int = 1, rate_hz: float = RATE_HZ, loop: str = "") -> str:
    """A configuration: the simulated omega.7 pressed with 3 N into walls that share 12 kN/m, all in contact at once.

    Args:
        law: on every wall.
        walls: how many.
        rate_hz: ticks a second [Hz].
        loop: more lines of its [loop] table.
    """
    wall = f"[[scene.walls]]\nstiffness_n_per_m = {12000.0 / max(walls, 1)}\n"
    hand = f'hand.force = {{ profile = "constant", newton = {-3.0 if walls else 0.0} }}\n'
    return (
        f"[loop]\nrate_hz = {rate_hz}\n{loop}\n"
        f'[device.options]\nmodel = "omega7"\n{hand}\n{wall * walls}\n[controller]\nlaw = "{law}"\n'
    )


def _is_simulated(text: str) -> bool:
    """Whether a configuration is without hardware: a benchmark pushes nothing that somebody may hold."""
    device = tomllib.loads(text).get("device", {})
    return bool(device.get("driver", "loopback") == "loopback")


def _shape(text: str) -> str:
    """What is left of a configuration without comments and numbers: files alike in it run the same tick."""
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    return re.sub(r"[-+]?\d[\d.e_]*", "0", "\n".join(line for line in lines if line))
