"""Whether a run is as it was written down."""

from __future__ import annotations

from tests.recorded.runs import RUNS


def check(name: str) -> None:
    """Run it once more.

    Raises:
        AssertionError: something is different, and what.
    """
    found = RUNS[name]().differences(name)
    assert not found, f'"{name}" is different; if it is to be, python -m tests.recorded: \n' + "\n".join(found[:20])
