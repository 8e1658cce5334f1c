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

MOTION = POSITION | ORIENTATION | VELOCITY | TURNING

SLOT_BYTES = 256
"""What one port has in shared memory: an update and room for the words that guard it."""

_FIELDS = Struct("<10q18d")

PACKED_BYTES = _FIELDS.size
"""How much of a slot an update takes."""


class Update:
    """All that a client has said of one name, newest of each.

    Attributes:
        said: which of the fields below were ever said, in bits; `RELEASED`: the client has let go.
        seq: the client's own number of its newest message.
        sent_ns: when the client sent it [ns of CLOCK_MONOTONIC]; 0 where it does not say, or is on another computer.
        received_ns: when the daemon took it [ns of CLOCK_MONOTONIC].
        position_ns, velocity_ns, orientation_ns, turning_ns: when the daemon took what first said the position, the
            velocity and so on that are in it: another one than before is said anew, the same one is only repeated [ns].
        client: a number for who has said it, by which whoever hears clients next knows it again; 0: no one.
        moved_seq: the client's own number of the message that said motion anew last; -1: none has.
        position_m: of the target or the object, one element an axis, 0.0 beyond [m].
        velocity_m_per_s: of the same [m/s].
        angular_velocity_rad_per_s: of the object, in the frame of the world [rad/s].
        force_n: on the device [N].
        orientation: of the object, a quaternion w x y z of any length.
        stiffness_n_per_m, damping_n_s_per_m: of the coupling or of the object.
    """

    __slots__ = (
        "angular_velocity_rad_per_s",
        "client",
        "damping_n_s_per_m",
        "force_n",
        "moved_seq",
        "orientation",
        "orientation_ns",
        "position_m",
        "position_ns",
        "received_ns",
        "said",
        "sent_ns",
        "seq",
        "stiffness_n_per_m",
        "turning_ns",
        "velocity_m_per_s",
        "velocity_ns",
    )

    def __init__(self) -> None:
        self.said = 0
        self.seq = -1
        self.sent_ns = 0
        self.received_ns = 0
        self.position_ns = 0
        self.velocity_ns = 0
        self.orientation_ns = 0
        self.turning_ns = 0
        self.client = 0
        self.moved_seq = -1
        self.position_m = [0.0, 0.0, 0.0]
        self.velocity_m_per_s = [0.0, 0.0, 0.0]
        self.angular_velocity_rad_per_s = [0.0, 0.0, 0.0]
        self.force_n = [0.0, 0.0, 0.0]
        self.orientation = [1.0, 0.0, 0.0, 0.0]
        self.stiffness_n_per_m = 0.0
        self.damping_n_s_per_m = 0.0

    def stamp(self, said: int, said_ns: int) -> None:
        """Note when motion was said.

        Args:
            said: what of it, in bits.
            said_ns: when the daemon took it, or another number that is new [ns].
        """
        if said & POSITION:
            self.position_ns = said_ns
        if said & VELOCITY:
            self.velocity_ns = said_ns
        if said & ORIENTATION:
            self.orientation_ns = said_ns
        if said & TURNING:
            self.turning_ns = said_ns

    def said_s(self, said_ns: int) -> float:
        """How long before this message a motion in it was said first [s].

        Args:
            said_ns: when the daemon took that [ns].
        """
        return max(0.0, (self.received_ns - said_ns) * 1e-9)


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
        update.position_ns,
        update.velocity_ns,
        update.orientation_ns,
        update.turning_ns,
        update.client,
        update.moved_seq,
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
    into.position_ns, into.velocity_ns, into.orientation_ns, into.turning_ns = values[4:8]
    into.client, into.moved_seq = values[8:10]
    into.position_m[:] = values[10:13]
    into.velocity_m_per_s[:] = values[13:16]
    into.angular_velocity_rad_per_s[:] = values[16:19]
    into.force_n[:] = values[19:22]
    into.orientation[:] = values[22:26]
    into.stiffness_n_per_m, into.damping_n_s_per_m = values[26:]
