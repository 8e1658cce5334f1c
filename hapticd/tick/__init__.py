"""One tick: sample in, force out; pure arithmetic that knows no clock, no device and no process."""
