"""Limits and orders that others have published, against the device model."""
