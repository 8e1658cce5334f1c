"""Just enough of XDF to write what LabRecorder would: a header, samples and a footer a stream.

https://github.com/sccn/xdf/wiki/Specifications
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def write_xdf(path: Path, streams: Sequence[tuple[str, Sequence[Sequence[Any]], Sequence[float]]]) -> None:
    """Write streams.

    Args:
        path: where.
        streams: description (XML as LSL has it), samples and their time stamps, of each.
    """
    with path.open("wb") as file:
        file.write(b"XDF:")
        file.write(_chunk(1, b'<?xml version="1.0"?><info><version>1.0</version></info>'))
        for number, (described, samples, times_s) in enumerate(streams, 1):
            file.write(_chunk(2, struct.pack("<I", number) + described.encode()))
            content = struct.pack("<I", number) + _length(len(samples))
            for sample, time_s in zip(samples, times_s, strict=True):
                content += struct.pack("<Bd", 8, time_s)
                for value in sample:
                    content += _text(value) if isinstance(value, str) else struct.pack("<d", value)
            file.write(_chunk(3, content))
            last = f"<first_timestamp>{times_s[0]!r}</first_timestamp><last_timestamp>{times_s[-1]!r}</last_timestamp>"
            footer = f"<?xml version='1.0'?><info>{last}<sample_count>{len(samples)}</sample_count></info>"
            file.write(_chunk(6, struct.pack("<I", number) + footer.encode()))


def _chunk(tag: int, content: bytes) -> bytes:
    return _length(len(content) + 2) + struct.pack("<H", tag) + content


def _length(count: int) -> bytes:
    return struct.pack("<BI", 4, count)


def _text(value: str) -> bytes:
    return _length(len(value.encode())) + value.encode()
