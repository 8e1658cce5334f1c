"""Which test runs first on a slip: one that has noticed others, then the quickest; and what a run has to tell."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

import pytest
from hypothesis import Phase, settings

SHORTEST_LIMIT_S = 20.0
"""Shortest time limit of one test [s]; else twenty times what it takes without a slip, and five times its file: the
first of its tests to run may have to compile what another one had compiled before."""


@dataclass(frozen=True, slots=True)
class Told:
    """What a run of a room's tests has to tell.

    Attributes:
        took_s: how long each test took, with what it sets up [s].
        failed: those that failed.
    """

    took_s: dict[str, float]
    failed: list[str]


@dataclass(slots=True)
class Experience:
    """What is known of a room's tests.

    Attributes:
        took_s: how long each takes without a slip [s].
        noticed: how many slips each has noticed.
    """

    took_s: dict[str, float] = field(default_factory=dict)
    noticed: Counter[str] = field(default_factory=Counter)

    def order(self) -> list[str]:
        """The tests: first those that notice most in the shortest time, then file by file, the quickest first."""
        files = self.files_s()
        noticing = sorted(self.noticed, key=lambda name: -self.noticed[name] / (0.05 + self.took_s.get(name, 0.0)))
        others = sorted(self.took_s, key=lambda name: (files[_file(name)], _file(name), self.took_s[name]))
        return [*noticing, *(name for name in others if name not in self.noticed)]

    def files_s(self) -> dict[str, float]:
        """How long the tests of each file take [s]."""
        files: defaultdict[str, float] = defaultdict(float)
        for name, took_s in self.took_s.items():
            files[_file(name)] += took_s
        return files


class InOrder:
    """A plugin of pytest: runs tests in an order, each with a time limit, and tells what became of them.

    Properties get the same examples every time and are not made small: that one fails is all that is asked.

    Args:
        experience: of the room's tests.
        to: where it is told, at the end.
    """

    def __init__(self, experience: Experience, to: Connection) -> None:
        self._place = {name: place for place, name in enumerate(experience.order())}
        files = experience.files_s()
        self._limits_s = {
            name: max(SHORTEST_LIMIT_S, 20.0 * took_s + 5.0 * files[_file(name)])
            for name, took_s in experience.took_s.items()
        }
        self._to = to
        self._told = Told({}, [])

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        """After the conftest, before any test is read."""
        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("slips", settings.default, phases=phases, derandomize=True, database=None)
        settings.load_profile("slips")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """In order; what is not known stays at the end, as it is."""
        items.sort(key=lambda item: self._place.get(item.nodeid, len(self._place)))
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


def _file(name: str) -> str:
    return name.split("::")[0]
