"""Watch and command a running daemon.

    from hapticd.client import Cycle, Gap, connect

    with connect(topics=[Cycle]) as daemon:
        daemon.arm()
        for record in daemon:
            print(record)

`connect` is the one way in, the same as `hapticd.connect`. `Client` is the subscription below it, for a program that
starts before its daemon. The contract behind both is docs/telemetry.md; any language with ZeroMQ and msgpack can do
the same.
"""

from hapticd.client.commands import RefusedConfigError, RefusedError
from hapticd.client.connection import Client
from hapticd.client.daemon import DaemonClient, connect
from hapticd.client.decode import decode
from hapticd.client.remote import DrivenState, RemotePort, RemoteState
from hapticd.errors import ClientError, EndpointError, InstanceError, SchemaError, SilenceError, WireError
from hapticd.keys.client import RefusedKeyError
from hapticd.telemetry.records import Cycle, Damping, Energy, Event, Gap, Input, Position, Record, Status, Timing, Touch
from hapticd.tick.event import EventCode

__all__ = [
    "Client",
    "ClientError",
    "Cycle",
    "DaemonClient",
    "Damping",
    "DrivenState",
    "EndpointError",
    "Energy",
    "Event",
    "EventCode",
    "Gap",
    "Input",
    "InstanceError",
    "Position",
    "Record",
    "RefusedConfigError",
    "RefusedError",
    "RefusedKeyError",
    "RemotePort",
    "RemoteState",
    "SchemaError",
    "SilenceError",
    "Status",
    "Timing",
    "Touch",
    "WireError",
    "connect",
    "decode",
]
