"""Read a daemon's telemetry.

    from hapticd.client import Cycle, Gap, connect

    with connect(topics=[Cycle]) as client:
        for record in client:
            print(record)

The contract behind it is docs/telemetry.md; any language with ZeroMQ and msgpack can read the same.
"""

from hapticd.client.connection import Client, connect
from hapticd.client.decode import decode
from hapticd.errors import ClientError, SchemaError, SilenceError, WireError
from hapticd.keys.client import RefusedKeyError
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Gap, Input, Position, Record, Status, Timing

__all__ = [
    "Client",
    "ClientError",
    "Cycle",
    "Damping",
    "Energy",
    "Event",
    "Gap",
    "Input",
    "Position",
    "Record",
    "RefusedKeyError",
    "SchemaError",
    "SilenceError",
    "Status",
    "Timing",
    "WireError",
    "connect",
    "decode",
]
