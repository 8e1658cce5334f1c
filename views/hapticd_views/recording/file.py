"""An MCAP file that is being written: whole chunks on the disk, whatever happens to us or to the disk.

The MCAP library writes into memory. What it wrote goes to the disk in one piece that ends with a chunk; a piece that
did not get there whole is cut off again. So what lies on the disk is always a file that readers can read.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import IO, Any, cast

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, Writer

from hapticd.errors import ConfigError, HapticdError
from hapticd.version import __version__
from hapticd_views.recording.messages import encoder_of, schema_of, topic_of
from hapticd_views.recording.output import being_recorded, hold, place

LIBRARY = f"hapticd {__version__}"
"""What the header of a recording names as its writer."""

_LATEST_S = 1e10  # a time that is none, as of a forged message, is no reason to end


class DiskError(HapticdError):
    """The disk does not take any more; what was written before stays readable."""


class RecordingFile:
    """One MCAP file, open for writing.

    Args:
        path: where.
        overwrite: whether a file of this name may be replaced.

    Attributes:
        path: where it is.
        size: bytes on the disk.

    Raises:
        ConfigError: it cannot be created there, or another recorder is writing it.
        DiskError: the disk is full.
    """

    def __init__(self, path: Path, overwrite: bool = False) -> None:
        self.path = place(path, overwrite)
        self.size = 0
        self._ends: list[int] = []  # where the file may end: behind each of the last pieces that are whole on the disk
        self._pending = BytesIO()
        self._writer = Writer(cast("IO[bytes]", _Counted(self)), chunk_size=1 << 22)
        self._channels: dict[type[Any], tuple[int, Any]] = {}
        flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (0 if overwrite else os.O_EXCL)
        try:
            self._fd = os.open(self.path, flags, 0o666)
            if not hold(self._fd):
                os.close(self._fd)
                raise being_recorded(path)
            os.ftruncate(self._fd, 0)
        except OSError as error:
            raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
        self._writer.start(library=LIBRARY)
        self._write_out()

    def add(self, record: Any, timestamp: float) -> None:
        """Take a record in; it is on the disk after the next `commit`.

        Args:
            record: of telemetry, a note or a gap.
            timestamp: its time [s since the epoch].
        """
        kind = type(record)
        if kind not in self._channels:
            schema = json.dumps(schema_of(kind)).encode()
            schema_id = self._writer.register_schema(topic_of(kind), "jsonschema", schema)
            channel_id = self._writer.register_channel(topic_of(kind), "json", schema_id)
            self._channels[kind] = channel_id, encoder_of(kind)
        channel_id, encode = self._channels[kind]
        time_ns = round(min(max(timestamp, 0.0), _LATEST_S) * 1e9)
        sequence = getattr(record, "seq", 0) & 0xFFFFFFFF
        self._writer.add_message(channel_id, time_ns, encode(record), time_ns, sequence)

    def describe(self, name: str, told: Mapping[str, str]) -> None:
        """Take in a metadata record, which stands before the messages of this chunk."""
        plain = {key: text.encode("utf-8", "replace").decode() for key, text in told.items()}
        self._writer.add_metadata(name, plain)

    def commit(self) -> None:
        """Close the chunk and hand everything to the system: a kill loses nothing of it.

        Raises:
            DiskError: it could not be written; the file ends before it, and is closed.
        """
        self._writer.flush()
        self._write_out()

    def sync(self) -> None:
        """Return when it is on the disk: a power cut loses nothing of it.

        Raises:
            DiskError: the disk failed, or the file was removed and cannot be read any more; it is closed.
        """
        try:
            os.fdatasync(self._fd)
            names = os.fstat(self._fd).st_nlink
        except OSError as error:
            self._give_up(error)
        if not names:
            os.close(self._fd)
            raise DiskError(f"{self.path}: was removed while it was recorded; the recording ends, and it is lost")

    def close(self) -> None:
        """Write the index, and close.

        Raises:
            DiskError: there was no room for it, and the file is readable without; or the file was removed.
        """
        self._writer.finish()
        self._write_out()
        self.sync()
        os.close(self._fd)

    def _write_out(self) -> None:
        piece = self._pending.getbuffer()
        try:
            done = 0
            while done < len(piece):
                done += os.write(self._fd, piece[done:])
        except OSError as error:
            piece.release()
            self._give_up(error)
        self.size += done
        self._ends = [*self._ends[-1:], self.size]
        piece.release()
        self._pending.seek(0)
        self._pending.truncate()

    def _give_up(self, error: OSError) -> None:
        """End the file behind what is whole, and say why."""
        try:
            for end in reversed(self._ends):  # where not even the end has room, the last piece makes some
                os.ftruncate(self._fd, end)
                os.lseek(self._fd, end, os.SEEK_SET)
                try:
                    if os.write(self._fd, _BARE_END) == len(_BARE_END):
                        break
                except OSError:
                    continue
            else:
                os.ftruncate(self._fd, min(self._ends, default=0))
            if not self._ends:
                self.path.unlink()  # an empty one, in the way of the next try
        except OSError:
            pass  # the disk is gone, and with it what could be said in it
        finally:
            os.close(self._fd)
        state = "the recording ends here and is readable" if self._ends else "not even a beginning has room"
        raise DiskError(f"{self.path}: {error.strerror}: {state}; make room, or name another --output") from error


class _Counted:
    """The stream that the MCAP library writes to: memory, at the place in the file where it will lie."""

    def __init__(self, file: RecordingFile) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        return self._file._pending.write(data)

    def tell(self) -> int:
        return self._file.size + self._file._pending.tell()

    def flush(self) -> None:
        """What is pending is written out by `RecordingFile`."""


def _bare_end() -> bytes:
    """The end of a file without index: readers go through it from the start."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC


_BARE_END = _bare_end()
