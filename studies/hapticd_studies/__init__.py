"""Science with the daemon's own parts, offline: one run of a configuration, and studies over many."""
