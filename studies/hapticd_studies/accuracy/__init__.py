"""The trade between speed and accuracy, measured for a configuration: its device, its loop, its telemetry."""
