"""What a client has said of one port, and how that lies in shared memory.

Who writes an update has looked at it: every number is finite and within the limits of its port.
"""

from __future__ import annotations

from struct import Struct

POSITION = 1
ORIENTATION = 2
VELOCITY = 4
TURNING = 8
STIFFNESS = 16
DAMPING = 32
FORCE = 64
RELEASED = 128
"""Bits of `Update.said`; of what was never said the field has no meaning."""

SLOT_BYTES = 256
"""What one port has in shared memory: an update and room for the words that guard it."""

_FIELDS = Struct("<qqqq18d")

PACKED_BYTES = _FIELDS.size
"""How much of a slot an update takes."""


class Update:
    """All that a client has said of one name, newest of each.

    Attributes:
        said: which of the fields below were ever said, in bits; `RELEASED`: the client has let go.
        seq: the client's own number of its newest message.
        sent_ns: when the client sent it [ns of CLOCK_MONOTONIC]; 0 where it does not say, or is on another computer.
        received_ns: when the daemon took it [ns of CLOCK_MONOTONIC].
        position_m: of the target or the object, one element an axis, 0.0 beyond [m].
        velocity_m_per_s: of the same [m/s].
        angular_velocity_rad_per_s: of the object, in the frame of the world [rad/s].
        force_n: on the device [N].
        orientation: of the object, a quaternion w x y z of any length.
        stiffness_n_per_m, damping_n_s_per_m: of the coupling or of the object.
    """

    __slots__ = (
        "angular_velocity_rad_per_s",
        "damping_n_s_per_m",
        "force_n",
        "orientation",
        "position_m",
        "received_ns",
        "said",
        "sent_ns",
        "seq",
        "stiffness_n_per_m",
        "velocity_m_per_s",
    )

    def __init__(self) -> None:
        self.said = 0
        self.seq = -1
        self.sent_ns = 0
        self.received_ns = 0
        self.position_m = [0.0, 0.0, 0.0]
        self.velocity_m_per_s = [0.0, 0.0, 0.0]
        self.angular_velocity_rad_per_s = [0.0, 0.0, 0.0]
        self.force_n = [0.0, 0.0, 0.0]
        self.orientation = [1.0, 0.0, 0.0, 0.0]
        self.stiffness_n_per_m = 0.0
        self.damping_n_s_per_m = 0.0


def pack(update: Update, view: memoryview | bytearray, at: int) -> None:
    """Write an update.

    Args:
        update: it.
        view: where to.
        at: offset in it [bytes]; `PACKED_BYTES` from there on are written.
    """
    _FIELDS.pack_into(
        view,
        at,
        update.said,
        update.seq,
        update.sent_ns,
        update.received_ns,
        *update.position_m,
        *update.velocity_m_per_s,
        *update.angular_velocity_rad_per_s,
        *update.force_n,
        *update.orientation,
        update.stiffness_n_per_m,
        update.damping_n_s_per_m,
    )


def unpack(view: memoryview | bytearray | bytes, at: int, into: Update) -> None:
    """Read an update into one that is there.

    Args:
        view: where from.
        at: offset in it [bytes].
        into: what is filled; its lists stay the same ones.
    """
    values = _FIELDS.unpack_from(view, at)
    into.said, into.seq, into.sent_ns, into.received_ns = values[:4]
    into.position_m[:] = values[4:7]
    into.velocity_m_per_s[:] = values[7:10]
    into.angular_velocity_rad_per_s[:] = values[10:13]
    into.force_n[:] = values[13:16]
    into.orientation[:] = values[16:20]
    into.stiffness_n_per_m, into.damping_n_s_per_m = values[20:]
