"""What `hapticd simulate --replay` runs for an MCAP file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hapticd.progress import progress_bar
from hapticd_views.recording.output import place
from hapticd_views.replay.output import check, write
from hapticd_views.replay.replay import laws_of, replay


def side_by_side(
    file: Path,
    config: Path | None,
    laws: Sequence[str],
    hand: str,
    duration_s: float | None,
    output: Path | None,
    overwrite: bool,
) -> tuple[dict[str, Any], list[str]]:
    """Replay a recording, and write what was asked for.

    Returns:
        The table for programs, and for people.

    Raises:
        ConfigError: what was asked for cannot be.
        HapticdError: there is nothing to replay, or the output cannot be written.
    """
    if output is not None:
        check(output)
        place(output, overwrite)
    with progress_bar(len(laws_of(laws)), "replaying") as tell:
        made = replay(file, config, laws, hand, duration_s, progress=lambda done: tell(completed=done))
    if output is not None:
        write(made, output, overwrite)
    return made.summary, [*made.lines, *([f"in {output}"] if output else [])]
