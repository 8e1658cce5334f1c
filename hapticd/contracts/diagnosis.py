"""What a driver says of this computer: whether it has what the driver needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing that is so.

    Attributes:
        mark: `ok`; `advice`, it works but could be better; `problem`, no device can be used.
        text: what is so, in one line.
        mend: lines for a shell that mend it, as they stand; one that no command can mend is a comment, `# ...`.
    """

    mark: Literal["ok", "advice", "problem"]
    text: str
    mend: tuple[str, ...] = ()
