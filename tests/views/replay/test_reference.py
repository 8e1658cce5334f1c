"""Today's tick and laws, held to a recorded press that is in the repository.

When a difference is meant, `python -m tests.views.replay.reference` takes it over.
"""

from __future__ import annotations

from pathlib import Path

from hapticd_views.recording import read
from tests.views.replay.reference import LAWS, PRESS, TABLE, TICKS, configuration, lines
from tests.views.replay.simulated import record


def test_every_law_answers_to_the_recorded_motion_as_it_did() -> None:
    assert lines(PRESS) == TABLE.read_text().splitlines()


def test_the_simulated_device_moves_as_it_did(tmp_path: Path) -> None:
    record(tmp_path / "again.mcap", configuration(), TICKS)
    then, now = read(PRESS).ticks, read(tmp_path / "again.mcap").ticks
    for name, column in then.items():
        assert now[name].tolist() == column.tolist(), name


def test_a_changed_law_is_a_changed_line(tmp_path: Path) -> None:
    """A damper of a millionth more changes its line, and no other."""
    values = {"controller.law": "damper", "controller.params.damping_n_s_per_m": 50.00005}
    changed = configuration().with_values(values)
    record(tmp_path / "press.mcap", configuration(), TICKS, config_text=changed.text)
    before, after = TABLE.read_text().splitlines(), lines(tmp_path / "press.mcap")
    assert {line.split()[0] for line in set(after) - set(before)} == {"damper"}
    assert sorted(line.split()[0] for line in after[2:]) == sorted(["recorded", *LAWS])
