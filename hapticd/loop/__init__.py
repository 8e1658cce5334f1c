"""The loop, a process of its own: it owns the driver and runs the tick on time."""
