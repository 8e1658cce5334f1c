"""Which test runs first on a slip: one that comes by it and has noticed others, then the quickest."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

from tests.mutation.reach import Line, Reach, file_of

SHORTEST_LIMIT_S = 20.0
"""Shortest time limit of one test [s]; else twenty times what it takes without a slip, and five times its file: the
first of its tests to run may have to compile what another one had compiled before."""


@dataclass(slots=True)
class Experience:
    """What is known of a room's tests.

    Attributes:
        took_s: how long each takes without a slip [s].
        noticed: how many slips each has noticed.
        reach: what they come by.
    """

    took_s: dict[str, float] = field(default_factory=dict)
    noticed: Counter[str] = field(default_factory=Counter)
    reach: Reach = field(default_factory=Reach)

    def order(self, lines: Collection[Line] = ()) -> list[str]:
        """The tests that can notice a slip: first those that come by it, in the shortest time, then the others.

        Args:
            lines: of the slip; none: whatever is known of no line.
        """
        near = self.reach.tests(lines)
        files = self.reach.files(lines) if self.reach.lines else {file_of(name) for name in self.took_s}
        files_s = self.files_s()

        def place(name: str) -> tuple[bool, float, float, str, float]:
            took_s = self.took_s[name]
            worth = self.noticed[name] / (0.05 + took_s)
            return name not in near, -worth, files_s[file_of(name)], file_of(name), took_s

        return sorted((name for name in self.took_s if file_of(name) in files), key=place)

    def limits_s(self, names: Iterable[str]) -> dict[str, float]:
        """The time limit of each of these tests [s]."""
        files = self.files_s()
        return {name: max(SHORTEST_LIMIT_S, 20.0 * self.took_s[name] + 5.0 * files[file_of(name)]) for name in names}

    def files_s(self) -> dict[str, float]:
        """How long the tests of each file take [s]."""
        files: defaultdict[str, float] = defaultdict(float)
        for name, took_s in self.took_s.items():
            files[file_of(name)] += took_s
        return files
