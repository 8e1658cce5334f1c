"""The benchmark's C computes what the compiled Python computes, so that their times may be compared."""

from __future__ import annotations

import shutil

import pytest

from hapticd_bench.batch import measure


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_reference_in_c_ends_in_the_same_states_to_the_last_bit() -> None:
    """When this fails after a change of the energy-cycle law, batch_reference.c has to follow it."""
    figures = measure(points=60, seconds=1.0, repeats=1)
    assert figures.equal
    assert figures.one_core_ratio > 0.2
    assert figures.interpreted_ratio < 0.1
