"""Take every term out of a scene, alone and together, and find the smallest model that keeps every answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from hapticd.config.loading import LoadedConfig
from hapticd.errors import HapticdError
from hapticd.offline.rehearsal import rehearse
from hapticd.offline.run import Run
from hapticd_studies.scene.answers import Answers, answers
from hapticd_studies.scene.edits import Term
from hapticd_studies.scene.terms import reduced, terms_of
from hapticd_studies.scene.ticks import SETTLE_TICKS, tick_operations

_COUNTED = 20
"""Ticks, spread over the run, in which a model's instructions are counted."""

_MOST_TOGETHER = 60
"""Combinations of terms that are tried, largest first, before terms are taken out one by one."""


@dataclass(frozen=True, slots=True)
class Removal:
    """One term taken out by itself.

    Attributes:
        term: the term.
        answers: what the scene says without it; None where there is no such configuration.
        saved: instructions a tick that it takes, as a mean over the run.
        broken: the answers that change by more than the tolerance.
    """

    term: Term
    answers: Answers | None
    saved: float
    broken: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Scene:
    """What a scene needs.

    Attributes:
        loaded: the configuration.
        full: its run.
        tolerance: largest change of an answer, a share.
        operations: instructions a tick of the full model, as a mean over the run.
        removals: each term taken out alone.
        left_out: the terms that the smallest model does without.
        minimal: that model.
        minimal_answers: what it answers.
        minimal_operations: instructions a tick of it.
        proven: no other combination of terms that may go alone leaves out more of those; without it only no single
            further term can go.
        tried: models that were run.
    """

    loaded: LoadedConfig
    full: Run
    tolerance: float
    operations: float
    removals: Sequence[Removal]
    left_out: Sequence[Term]
    minimal: LoadedConfig
    minimal_answers: Answers
    minimal_operations: float
    proven: bool
    tried: int


def study(loaded: LoadedConfig, duration_s: float, tolerance: float, progress: Callable[[str], object]) -> Scene:
    """Find what a scene needs.

    Args:
        loaded: a configuration for a simulated device.
        duration_s: simulated time of each run [s].
        tolerance: largest change of an answer, a share.
        progress: told what is being tried.

    Raises:
        ConfigError: the configuration is not one for a simulated device.
    """
    return _Search(loaded, duration_s, tolerance, progress).result()


def steps(loaded: LoadedConfig) -> int:
    """How often `study` tells its progress at most."""
    terms = len(terms_of(loaded))
    return 1 + terms + min(_MOST_TOGETHER, 1 << terms)


class _Search:
    def __init__(
        self, loaded: LoadedConfig, duration_s: float, tolerance: float, progress: Callable[[str], object]
    ) -> None:
        self._loaded = loaded
        self._duration_s = duration_s
        self._tolerance = tolerance
        self._progress = progress
        progress("full model")
        self._full = rehearse(loaded, duration_s)
        self._operations = self._count(loaded)
        self._tried = 1

    def result(self) -> Scene:
        removals = [self._remove(term) for term in terms_of(self._loaded)]
        able = [one for one in removals if not one.broken]
        left_out, proven = self._together(able)
        left_out = self._further(left_out, [one.term for one in removals])
        minimal = reduced(self._loaded, left_out)
        run = rehearse(minimal, self._duration_s)
        return Scene(
            loaded=self._loaded,
            full=self._full,
            tolerance=self._tolerance,
            operations=self._operations,
            removals=removals,
            left_out=left_out,
            minimal=minimal,
            minimal_answers=answers(run, self._full),
            minimal_operations=self._count(minimal),
            proven=proven,
            tried=self._tried,
        )

    def _remove(self, term: Term) -> Removal:
        self._progress(f"without {term.name}")
        found = self._answers([term])
        if found is None:
            return Removal(term, None, 0.0, ("configuration",))
        saved = self._operations - self._count(reduced(self._loaded, [term]))
        return Removal(term, found, saved, tuple(found.broken(self._tolerance)))

    def _together(self, able: Sequence[Removal]) -> tuple[list[Term], bool]:
        """The most terms that can go together."""
        for count, subset in enumerate(_largest_first(able)):
            if count == _MOST_TOGETHER:
                break
            self._progress(f"without {len(subset)} terms together")
            if self._keeps([one.term for one in subset]):
                return [one.term for one in subset], True
        return [], False

    def _further(self, left_out: Sequence[Term], terms: Sequence[Term]) -> list[Term]:
        """What could not go alone may go now, as the steps of a sensor do with the filter that is made for them."""
        gone = list(left_out)
        again = True
        while again:
            again = False
            for term in terms:
                if term not in gone and self._keeps([*gone, term]):
                    gone.append(term)
                    again = True
        return [term for term in terms if term in gone]

    def _keeps(self, terms: Sequence[Term]) -> bool:
        if not terms:
            return True
        found = self._answers(terms)
        return found is not None and not found.broken(self._tolerance)

    def _answers(self, terms: Sequence[Term]) -> Answers | None:
        self._tried += 1
        try:
            return answers(rehearse(reduced(self._loaded, terms), self._duration_s), self._full)
        except HapticdError:  # such as a filter that a rate does not fit, or a device that cannot be stepped
            return None

    def _count(self, loaded: LoadedConfig) -> float:
        ticks = max(SETTLE_TICKS, round(self._duration_s / loaded.config.loop.period_s))
        counts = tick_operations(loaded, 1, _COUNTED, every=max(1, (ticks - 1) // _COUNTED))
        return sum(counts) / len(counts)


def _largest_first(able: Sequence[Removal]) -> Iterator[Sequence[Removal]]:
    """Every combination of removals, those of most terms first, among them those that save most."""
    for kept in range(len(able) + 1):
        subsets = combinations(able, len(able) - kept)
        yield from sorted(subsets, key=lambda subset: -sum(one.saved for one in subset))
