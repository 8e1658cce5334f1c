"""A recorded hand under other laws: `hapticd simulate --replay`. docs/replay.md."""
