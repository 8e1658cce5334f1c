"""Presses of the omega7 model with three axes on a ball, the edge of a box and a plane with friction."""

from __future__ import annotations

import math
import random

KINDS = ("ball", "edge", "plane")
STIFFNESSES = (12e3, 18e3, 20e3)
STARTS = 60
STILL_M = 5e-5


def unit(draw: random.Random) -> list[float]:
    """A direction, all alike likely."""
    while True:
        vector = [draw.gauss(0.0, 1.0) for _ in range(3)]
        length = math.hypot(*vector)
        if length > 0.1:
            return [value / length for value in vector]


def scene(kind: str, seed: int) -> tuple[str, list[float], list[float]]:
    """An object, a point on it, and from which direction the hand comes."""
    draw = random.Random(seed)
    if kind == "ball":
        n = unit(draw)
        centre = [draw.uniform(-0.01, 0.01) for _ in range(3)]
        at = [c + 0.03 * along for c, along in zip(centre, n, strict=True)]
        return f'shape = "sphere"\nradius_m = 0.03\nposition_m = {centre}\n', at, n
    if kind == "edge":
        angle = draw.uniform(math.radians(15.0), math.radians(75.0))
        at = [0.02, draw.uniform(-0.01, 0.01), 0.02]
        return 'shape = "box"\nsize_m = [0.04, 0.06, 0.04]\n', at, [math.cos(angle), 0.0, math.sin(angle)]
    n = unit(draw)
    t = unit(draw)
    off = sum(a * b for a, b in zip(t, n, strict=True))
    t = [a - off * b for a, b in zip(t, n, strict=True)]
    lean = draw.uniform(0.0, 0.5) / math.hypot(*t)
    d = [a + lean * b for a, b in zip(n, t, strict=True)]
    turn = [1.0 + n[2], -n[1], n[0], 0.0]
    friction = "static_friction = 0.8\ndynamic_friction = 0.6\n"
    return f'shape = "plane"\norientation = {turn}\n{friction}', [0.0] * 3, [a / math.hypot(*d) for a in d]


def press_text(kind: str, stiffness: float, law: str | None, seed: int) -> str:
    """The configuration of a press from a start of its own; without a law it is the default one."""
    what, at, d = scene(kind, seed)
    draw = random.Random(seed + 10_000)
    newton = draw.choice([1.0, 3.0, 6.0])
    height = draw.choice([0.0, 0.0005, 0.001, 0.003]) + 1e-5
    start = [a + height * b for a, b in zip(at, d, strict=True)]
    text = f"""
        [device.options]
        model = "omega7"
        axes = 3
        [device.options.space]
        linkage = "delta"
        position_m = {start}
        [device.options.space.hand]
        force = {{ profile = "constant", newton = {[-newton * a for a in d]} }}
        aim = {{ path = "hold", at_m = {at} }}
        stiffness_n_per_m = [400.0, 400.0, 400.0]
        [[scene.objects]]
        name = "{kind}"
        stiffness_n_per_m = {stiffness}
        {what}
    """
    if law is not None:
        text += f'[controller]\nlaw = "{law}"\n'
    return text.replace("\n        ", "\n")
