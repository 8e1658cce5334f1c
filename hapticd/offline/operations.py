"""What a call costs, counted and not timed: the instructions that the interpreter executes for it.

The same call gives the same count on every machine and under any load, so that settings can be ranked where timings
would waver. Counts are those of one Python version; what C functions do inside counts as the call of them.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any


def count_operations(call: Callable[[], object]) -> int:
    """Instructions of the interpreter that a call takes, all Python functions that it calls included."""
    return sum(operations_by_code(call).values())


def operations_by_code(call: Callable[[], object]) -> dict[CodeType, int]:
    """The same for each function by itself."""
    counts: dict[CodeType, int] = {}

    def each(frame: FrameType, event: str, _argument: Any) -> Any:
        frame.f_trace_opcodes = True
        frame.f_trace_lines = False
        if event == "opcode":
            counts[frame.f_code] = counts.get(frame.f_code, 0) + 1
        return each

    before = sys.gettrace()
    collecting = gc.isenabled()
    gc.disable()  # else finalizers of anything run in between and are counted
    sys.settrace(each)
    try:
        call()
    finally:
        sys.settrace(before)
        if collecting:
            gc.enable()
    return counts
