"""Rigs that speak the rig protocol of docs/rig-protocol.md, over a serial line or in raw HID reports."""
