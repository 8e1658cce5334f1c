"""Where a wall is stable: measured regions of laws over any two parameters, beside the analytic limits."""
