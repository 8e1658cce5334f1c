"""Which test runs first on a slip: one that has noticed others, then the quickest; and what a run has to tell."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

import pytest
from hypothesis import Phase, settings

from tests.mutation.reach import Follower, Line, Reach, file_of

SHORTEST_LIMIT_S = 20.0
"""Shortest time limit of one test [s]; else twenty times what it takes without a slip, and five times its file: the
first of its tests to run may have to compile what another one had compiled before."""


@dataclass(frozen=True, slots=True)
class Told:
    """What a run of a room's tests has to tell.

    Attributes:
        took_s: how long each test took, with what it sets up [s].
        failed: those that failed.
        reach: what they came by, where they were followed.
    """

    took_s: dict[str, float]
    failed: list[str]
    reach: Reach | None = None


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

    def files_s(self) -> dict[str, float]:
        """How long the tests of each file take [s]."""
        files: defaultdict[str, float] = defaultdict(float)
        for name, took_s in self.took_s.items():
            files[file_of(name)] += took_s
        return files


class InOrder:
    """A plugin of pytest: runs tests in an order, each with a time limit, and tells what became of them.

    Properties get the same examples every time and are not made small: that one fails is all that is asked.

    Args:
        experience: of the room's tests.
        order: the names of those that are to run; none: all, as they come.
        follower: notes what they come by, if that is asked.
        to: where it is told, at the end.
    """

    def __init__(self, experience: Experience, order: Sequence[str], follower: Follower | None, to: Connection) -> None:
        self._place = {name: place for place, name in enumerate(order)}
        files = experience.files_s()
        self._limits_s = {
            name: max(SHORTEST_LIMIT_S, 20.0 * took_s + 5.0 * files[file_of(name)])
            for name, took_s in experience.took_s.items()
        }
        self._to = to
        self._told = Told({}, [], follower.reach if follower else None)

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        """After the conftest, before any test is read."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("slips", settings.default, phases=phases, derandomize=True, database=None)
        settings.load_profile("slips")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """In order, and no others."""
        if self._place:
            items[:] = sorted(
                (item for item in items if item.nodeid in self._place), key=lambda item: self._place[item.nodeid]
            )
        for item in items:
            if item.nodeid in self._limits_s:
                item.add_marker(pytest.mark.timeout(self._limits_s[item.nodeid]), append=False)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """What a test, its setting up and its clearing away took."""
        self._told.took_s[report.nodeid] = self._told.took_s.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self._told.failed.append(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Tell."""
        self._to.send(self._told)
