"""Recordings: MCAP files that say by themselves what they are of. docs/recordings.md.

    from hapticd_views.recording import read

    recording = read("press.mcap")
    print(recording.receipt["law"], recording.ticks["position_m"][:, 0])

Needs the extra `record`.
"""

from hapticd_views.recording.messages import Note, RecordedGap
from hapticd_views.recording.reader import read
from hapticd_views.recording.recording import Recording

__all__ = ["Note", "RecordedGap", "Recording", "read"]
