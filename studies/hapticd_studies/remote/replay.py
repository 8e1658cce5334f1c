"""One of the random clients again, under each law."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from hapticd.config.remote import COME_IN_S
from hapticd.errors import ConfigError
from hapticd.offline.outcome import Outcome
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.remote.runs import COLUMNS, Case, draw, run
from hapticd_studies.remote.sweep import KINDS


def case_of(text: str, hand: str = "press", come_in_s: float = COME_IN_S) -> Case:
    """The client of `KIND:SEED:INDEX`, under a hand, with a coupling that comes in within a time.

    Raises:
        ConfigError: it is none.
    """
    found = re.fullmatch(rf"({'|'.join(KINDS)}):(\d{{1,18}}):(\d{{1,9}})", text)
    if found is None:
        raise ConfigError(f"--replay {text}: must be KIND:SEED:INDEX, as tool:1:57")
    return draw(int(found[2]), int(found[3]), found[1], hand, come_in_s)


def figures(case: Case, laws: Sequence[LawSpec]) -> Table:
    """What becomes of it under each law."""
    shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    shown.add_column("", no_wrap=True)
    for name in COLUMNS:
        shown.add_column(name, justify="right", overflow="fold")
    for law in laws:
        row = dict(zip(COLUMNS, run(case, law), strict=True))
        numbers = [f"{row[name]:.4g}" for name in COLUMNS[1:]]
        shown.add_row(escape(law.label.replace("damping_n_s_per_m=", "")), Outcome(int(row["outcome"])).words, *numbers)
    return shown
