"""One run of a configuration without a daemon: the same tick on the simulated device."""
