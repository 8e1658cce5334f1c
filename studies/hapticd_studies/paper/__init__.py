"""Every simulation, experiment and claim of the paper, run again: what reproduces, what does not, and why."""
