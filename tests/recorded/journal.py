"""What a run gives, tick by tick, and the same as it was written down before.

Nothing that a hand could feel or a subscriber could read changes without being noticed: every number of every tick
counts. Of a hundred ticks one number is kept, the sum of theirs, each with a weight of its own. What was meant to
change is written down anew, and the difference read:

    python -m tests.recorded
"""

from __future__ import annotations

import json
import math
import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

PLACE = Path(__file__).parent
BLOCK_TICKS = 100
SHARE = 1e-9
"""How much of its largest value a number may be off: what another libm rounds otherwise, and no more."""


class Journal:
    """The numbers of a run by name, and what was said in it.

    Attributes:
        tick: the one under way.
        said: events and the like, in order.
    """

    def __init__(self) -> None:
        self.tick = 0
        self.said: list[str] = []
        self._sums: defaultdict[str, list[float]] = defaultdict(list)
        self._largest: defaultdict[str, float] = defaultdict(float)

    def note(self, name: str, value: float | tuple[float, ...] | list[float]) -> None:
        """Keep a number of this tick, or several."""
        if isinstance(value, tuple | list):
            for index, each in enumerate(value):
                self.note(f"{name}[{index}]", each)
            return
        if not math.isfinite(value):
            name, value = f"{name} is {value}", 1.0
        sums = self._sums[name]
        block = self.tick // BLOCK_TICKS
        sums.extend([0.0] * (block + 1 - len(sums)))
        sums[block] += value * (1.0 + 0.37 * (self.tick % 7) + 0.011 * (self.tick % BLOCK_TICKS))
        self._largest[name] = max(self._largest[name], abs(value))

    def say(self, text: str) -> None:
        """Keep a text."""
        self.said.append(f"{self.tick}: {text}")

    def write(self, name: str) -> None:
        """Write all that down."""
        lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in sorted(self._folded().items())]
        said = json.dumps(self.said, indent=1)
        _file(name).write_text("{\n" + ",\n".join([f'"said": {said}', *lines]) + "\n}\n")

    def differences(self, name: str) -> list[str]:
        """What is not as it was written down."""
        before = json.loads(_file(name).read_text())
        said = before.pop("said")
        now = self._folded()
        found = [f"{one!r} was {other!r}" for one, other in zip(self.said, said, strict=False) if one != other]
        if len(said) != len(self.said):
            found.append(f"{len(self.said)} things were said, not {len(said)}")
        found += [f"{key}: only {'before' if key in before else 'now'}" for key in sorted(before.keys() ^ now.keys())]
        for key in sorted(before.keys() & now.keys()):
            (largest, *was), (_, *is_now) = before[key], now[key]
            off = [
                block
                for block, (one, other) in enumerate(zip(was, is_now, strict=False))
                if abs(one - other) > SHARE * largest * BLOCK_TICKS
            ]
            if off or len(was) != len(is_now):
                found.append(f"{key}: other values from tick {BLOCK_TICKS * (off or [len(was)])[0]} on")
        return found

    def _folded(self) -> dict[str, list[float]]:
        return {
            name: [float(f"{each:.12g}") for each in (self._largest[name], *sums)]
            for name, sums in self._sums.items()
        }  # fmt: skip


def forget_others(names: Iterable[str]) -> None:
    """Drop what was written down of runs that are none of these."""
    kept = {_file(name) for name in names}
    for file in (PLACE / "journals").iterdir():
        if file not in kept:
            file.unlink()


def _file(name: str) -> Path:
    return PLACE / "journals" / f"{re.sub('[^a-z0-9.]+', '-', name)}.json"
