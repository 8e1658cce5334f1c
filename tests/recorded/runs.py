"""Every run that is written down."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tests.recorded.clients import HEARD
from tests.recorded.courses import FOLLOWED
from tests.recorded.creases import VISITED
from tests.recorded.journal import Journal
from tests.recorded.laws import PRESSES
from tests.recorded.loops import run
from tests.recorded.scripts import SCRIPTS
from tests.recorded.walks import WALKS

RUNS: dict[str, Callable[[], Journal]] = {
    **WALKS,
    **PRESSES,
    **FOLLOWED,
    **HEARD,
    **VISITED,
    **{name: partial(run, script) for name, script in SCRIPTS.items()},
}
