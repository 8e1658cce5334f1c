"""Law sources as machine code, equal to the last bit."""
