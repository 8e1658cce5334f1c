"""Whether a loop may have left a force on the device, as a process that outlives it and its supervisor can see."""

from __future__ import annotations

import os

_THERE = b"!"


class ForceMark:
    """A byte in a file without a name, which the processes of a daemon have open until they end.

    Args:
        descriptor: of the file; None: make one.

    Attributes:
        descriptor: of the file, for a process that is to have it as well.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self.descriptor = os.memfd_create("force") if descriptor is None else descriptor

    @property
    def is_set(self) -> bool:
        """A loop has the device, or died with it."""
        return os.pread(self.descriptor, 1, 0) == _THERE

    def set(self) -> None:
        """A loop has the device from now on."""
        os.pwrite(self.descriptor, _THERE, 0)

    def clear(self) -> None:
        """The device has been let go of."""
        os.ftruncate(self.descriptor, 0)
