"""Fault records: the ticks around a fault, kept on disk, and what reads them."""
