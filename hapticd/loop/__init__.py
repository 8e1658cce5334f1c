"""The control process: it owns the driver and runs the tick on time."""
