"""Lab Streaming Layer: a daemon's ticks as a regular stream, what happens as a stream of texts. Extra `lsl`."""
