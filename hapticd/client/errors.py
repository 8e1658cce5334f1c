"""What can go wrong for a subscriber."""

from __future__ import annotations

from hapticd.contracts.errors import HapticdError


class ClientError(HapticdError):
    """Base of what can go wrong for a subscriber."""


class SilenceError(ClientError):
    """Nothing arrived in the time allowed."""


class SchemaError(ClientError):
    """The daemon speaks a version of the contract that this client does not know."""


class WireError(ClientError):
    """A message that is not what the contract says."""
