"""What is run: each law on each kind of evidence, block by block, and the constant dampers that it is held against."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.offline.outcome import Criterion
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.robustness import devices as robustness
from hapticd_studies.targets import hands, hindsight, presses
from hapticd_studies.transparency.devices import draw
from hapticd_studies.transparency.references import references
from hapticd_studies.transparency.runs import rows

Array = npt.NDArray[np.float64]

TAKEOVER_FORCES_N = tuple(1.0 + 0.2 * at for at in range(21))


@dataclass(frozen=True, slots=True)
class Size:
    """How much of everything.

    Attributes:
        pressed: random devices that are pressed, and as many with noise.
        moved: random devices under moving hands.
        moved_s: how long those move [s].
        based: of them, under hands of ten minutes, or `based_s`.
        based_s: [s].
        starts: of the omega7 model, at each wall and force.
    """

    pressed: int
    moved: int
    moved_s: float
    based: int
    based_s: float
    starts: int


USUAL = ("pressed", "noisy", "known", "moved", "stiffened", "based", "softening", "taking over")
"""The parts that the targets ask for."""
MOVED_ONLY = ("moved",)
"""The parts of a front."""
WITH_HINDSIGHT = (*USUAL, "hindsight")
"""The targets, and dampers chosen for each device."""


def size_of(share: float) -> Size:
    """This share of 2000 presses, 490 hands of 20 s, 140 of ten minutes and 60 starts; every hand at least once."""
    return Size(
        max(10, round(2000 * share)),
        7 * max(1, round(70 * share)),
        20.0,
        7 * max(1, round(20 * share)),
        600.0,
        max(2, round(60 * share)),
    )


@dataclass(frozen=True, slots=True)
class Part:
    """One kind of evidence.

    Attributes:
        cells: how many rows it has.
        most: of them in one block.
        of_law: the rows of some cells under a law, or none.
        of_dampers: those of the constant dampers, or none.
    """

    cells: int
    most: int
    of_law: Callable[[Sequence[int], LawSpec, int | None], list[Row]] | None = None
    of_dampers: Callable[[Sequence[int], int | None], list[Row]] | None = None


@dataclass(frozen=True, slots=True)
class TargetsPlan:
    """What is wanted.

    Attributes:
        seed: of all random devices and hands.
        size: how much.
        laws: which are held against the targets.
        criterion: what still and in place mean.
        only: the parts that are run.
    """

    seed: int
    size: Size
    laws: Sequence[LawSpec]
    criterion: Criterion
    only: tuple[str, ...] = USUAL

    def job(self) -> Job:
        """Every law on every part, the constant dampers first."""
        spec = {
            "seed": self.seed,
            "size": asdict(self.size),
            "laws": [{"label": law.label, "name": law.name, "values": dict(law.values)} for law in self.laws],
            "criterion": asdict(self.criterion),
            "only": list(self.only),
        }
        names = tuple(sorted({"damper", *(law.name for law in self.laws)}))
        return Job(_block, spec, tuple(size for _, _, sizes in self._cut() for size in sizes), names)

    def tables(self, blocks: Sequence[list[Row]]) -> list[dict[str, Array]]:
        """Of the constant dampers and of each law a table a part, with a row a cell."""
        found: list[dict[str, Array]] = [{} for _ in range(1 + len(self.laws))]
        at = 0
        for law, name, sizes in self._cut():
            found[law][name] = np.array(in_order(sizes, blocks[at : at + len(sizes)]), dtype=float)
            at += len(sizes)
        return found

    def _cut(self) -> list[tuple[int, str, tuple[int, ...]]]:
        return _cut(parts(self.seed, self.size, self.criterion, self.only), len(self.laws))


def parts(seed: int, size: Size, criterion: Criterion, only: Sequence[str]) -> dict[str, Part]:
    """The evidence that is named, by name."""

    def pressed(cells: Sequence[int]) -> list[robustness.Device]:
        return [robustness.draw(seed, index) for index in cells]

    def noisy(cells: Sequence[int]) -> list[robustness.Device]:
        return [presses.noisy(seed, index) for index in cells]

    def moved(cells: Sequence[int]) -> list[Any]:
        return [draw(seed, index) for index in cells]

    known = [*presses.omega_starts(size.starts), *presses.paper_starts()]

    def started(cells: Sequence[int]) -> list[presses.Start]:
        return [known[index] for index in cells]

    every = {
        "pressed": Part(
            size.pressed,
            250,
            lambda cells, law, threads: presses.at_rest(pressed(cells), law, criterion, threads),
            lambda cells, threads: presses.holdable(pressed(cells), criterion, threads),
        ),
        "noisy": Part(
            size.pressed,
            250,
            lambda cells, law, threads: presses.at_rest(noisy(cells), law, criterion, threads),
            lambda cells, threads: presses.holdable(noisy(cells), criterion, threads),
        ),
        "known": Part(
            len(known),
            100,
            lambda cells, law, threads: presses.felt_at_rest(started(cells), law, criterion, threads),
            lambda cells, threads: presses.least_felt(started(cells), criterion, threads),
        ),
        "moved": Part(
            size.moved,
            20,
            lambda cells, law, threads: rows(moved(cells), law, size.moved_s, criterion, threads),
            lambda cells, threads: references(moved(cells), criterion, threads),
        ),
        "stiffened": Part(
            size.moved, 100, lambda cells, law, threads: hands.stiffened(moved(cells), law, criterion, threads)
        ),
        "based": Part(
            size.based,
            2,  # a trace of ten minutes takes up to 115 MB
            lambda cells, law, threads: hands.long_moved(moved(cells), law, size.based_s, criterion, threads),
        ),
        "softening": Part(
            len(TAKEOVER_FORCES_N),
            len(TAKEOVER_FORCES_N),
            lambda cells, law, threads: hands.softening([TAKEOVER_FORCES_N[at] for at in cells], law, threads),
        ),
        "taking over": Part(
            len(TAKEOVER_FORCES_N),
            len(TAKEOVER_FORCES_N),
            lambda cells, law, threads: hands.taking_over([TAKEOVER_FORCES_N[at] for at in cells], law, threads),
        ),
        "hindsight": Part(
            size.moved,
            20,
            of_dampers=lambda cells, threads: hindsight.chosen(moved(cells), size.moved_s, criterion, threads),
        ),
    }
    return {name: every[name] for name in only}


def _cut(found: dict[str, Part], laws: int) -> list[tuple[int, str, tuple[int, ...]]]:
    """Law (0: the dampers), part and sizes of its blocks."""
    return [
        (law, name, block_sizes(part.cells, part.most))
        for law in range(1 + laws)
        for name, part in found.items()
        if (part.of_law if law else part.of_dampers) is not None
    ]


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    found = parts(spec["seed"], Size(**spec["size"]), Criterion(**spec["criterion"]), spec["only"])
    for law, name, sizes in _cut(found, len(spec["laws"])):
        if block < len(sizes):
            cells, part = list(block_cells(sizes, block)), found[name]
            if law and part.of_law is not None:
                return part.of_law(cells, LawSpec(**spec["laws"][law - 1]), threads)
            assert part.of_dampers is not None
            return part.of_dampers(cells, threads)
        block -= len(sizes)
    raise IndexError(block)
