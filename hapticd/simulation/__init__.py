"""The simulated device: one model for the loopback driver and for every study."""
