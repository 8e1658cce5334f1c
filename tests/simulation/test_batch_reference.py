"""The benchmark's C computes what the compiled Python computes, so that their times may be compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hapticd import plugins
from hapticd.simulation.batch import Batch
from hapticd_bench.batch import Reference, grid, measure


@pytest.mark.parametrize("settling", [False, True], ids=["no-target", "every-other-has-a-target"])
def test_the_reference_in_c_ends_in_the_same_states_to_the_last_bit(settling: bool, tmp_path: Path) -> None:
    """When this fails after a change of the kernel or the energy-cycle law, batch_reference.c has to follow it."""
    loops = grid(36)
    if settling:
        loops[::2] = [replace(point, target_m=-0.5e-3, band_m=0.1e-3) for point in loops[::2]]
    batch = Batch(plugins.law("energy-cycle"), loops, 0.5, ledger=False)
    reference = Reference(batch, tmp_path)
    reference.run()
    assert reference.agrees_with(batch)


@pytest.mark.nightly
def test_the_benchmark_finds_them_alike_and_compiled_python_near_c() -> None:
    figures = measure(points=60, seconds=1.0, repeats=1)
    assert figures.equal
    assert figures.one_core_ratio > 0.2
    assert figures.interpreted_ratio < 0.1
