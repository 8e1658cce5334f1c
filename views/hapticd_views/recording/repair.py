"""Make a complete file of one that was cut: everything that can be read, with an index and an end."""

from __future__ import annotations

import os
from pathlib import Path

from mcap.records import Channel, Metadata, Schema
from mcap.writer import Writer

from hapticd_views.recording.file import LIBRARY
from hapticd_views.recording.output import part_of
from hapticd_views.recording.scan import Scan


def repair(path: Path, output: Path, overwrite: bool = False) -> tuple[int, str]:
    """Copy what is whole.

    Args:
        path: the file, of any origin.
        output: where the complete one goes; it appears when it is complete.
        overwrite: whether a file of this name may be replaced.

    Returns:
        How many messages it has, and why the first file ended early; "" when it did not.

    Raises:
        ConfigError: the output cannot be written there.
        HapticdError: the file cannot be read, is no MCAP file, or the disk is full.
    """
    scan = Scan(path)
    with part_of(output, overwrite) as part, part.open("xb") as file:
        writer = Writer(file, chunk_size=1 << 28)  # chunks end where they ended
        writer.start(library=LIBRARY)
        count = _copy(scan, writer)
        writer.finish()
        file.flush()
        os.fsync(file.fileno())
    return count, scan.cut


def _copy(scan: Scan, writer: Writer) -> int:
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    count = 0
    for piece in scan.pieces():
        if isinstance(piece, Metadata):
            writer.add_metadata(piece.name, piece.metadata)
            continue
        for record in piece:
            if isinstance(record, Schema):
                if record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel):
                if record.id not in channels and record.schema_id in schemas:
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                    )
            elif record.channel_id in channels:
                channel = channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
                count += 1
        writer.flush()
    return count
