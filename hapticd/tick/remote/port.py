"""What a client drives: who it is, how old its last word is, and what telemetry tells of it."""

from __future__ import annotations

from hapticd.config.remote import PortLimits
from hapticd.tick.remote.port_state import PortState
from hapticd.tick.remote.update import RELEASED, Update

__all__ = ["QUIET_S", "Port", "PortState"]

QUIET_S = 1.0
"""Shortest time between two events of one kind about one port [s]."""

_HELD, _STALE, _RELEASED = PortState.HELD, PortState.STALE, PortState.RELEASED


class Port:
    """One thing that a client drives.

    Args:
        limits: what it may do.
        axes: of the device.
        period_s: nominal time between ticks [s].

    Attributes:
        name: who it is, through a reload too.
        kind: "object", "coupling" or "force".
        limits: in force now.
        state: how it stands with its client.
        seq: the client's own number of the message that is in force; -1: none is.
        age_s: how old what it says is: since its client sent it, or the daemon took it where that is not known [s].
        force_n: force on the device that was applied last, one element an axis [N].
        impulse_n_s: the sum of the port's own force times how long it was applied, since the port exists. The law's
            damping is in it where it acts against the target; against the ground, its reaction is no client's [N s].
        target_m: where the followed target is; of a force 0 [m].
        news: what has become of it since it was last asked; the loop takes and clears it.
    """

    __slots__ = (
        "_back_s",
        "_new",
        "_period_s",
        "_silent",
        "_stale_s",
        "_told",
        "age_s",
        "force_n",
        "impulse_n_s",
        "kind",
        "limits",
        "name",
        "news",
        "seq",
        "state",
        "target_m",
    )

    def __init__(self, limits: PortLimits, axes: int, period_s: float) -> None:
        self.limits = limits
        self._period_s = period_s
        self._new = False  # what was heard last has come since the last tick
        self.name = limits.name
        self.kind = limits.kind
        self.state = PortState.IDLE
        self.seq = -1
        self.age_s = 0.0
        self.force_n = [0.0] * axes
        self.impulse_n_s = [0.0] * axes
        self.target_m = [0.0] * axes
        self.news: PortState | None = None
        self._silent = False  # its client, when it was last heard of
        self._told = False  # the same, as it was told last
        self._stale_s = self._back_s = QUIET_S  # since either was told last

    @property
    def object_index(self) -> int:
        """Which object of the scene it is; -1: none."""
        return -1

    @property
    def work_j(self) -> float:
        """What the client's motion, changes and forces have put in, less what they took [J]."""
        raise NotImplementedError

    def law_values(self) -> tuple[float, float, float]:
        """Stiffness in force [N/m], damping of the law [N s/m] and the mass that it has felt [kg], for a record."""
        raise NotImplementedError

    def take(self, update: Update, age_s: float = 0.0) -> None:
        """Take what the client has said; called between ticks, keeps nothing of the update itself.

        Args:
            update: of this port; numbers beyond the port's limits count as the limit.
            age_s: how old it is [s]. What has waited for longer than `hold_s` says nothing: who said it may have gone.
        """
        if update.said & RELEASED:
            if self.state is _HELD:
                self._become(_RELEASED)
            return
        if age_s > self.limits.hold_s:
            return
        if self._hear(update, age_s):  # else it holds nothing: what another client has said before grows old
            self.age_s = age_s
            self._new = True
            self.seq = update.seq
            if self.state is not _HELD:
                self._become(_HELD)

    def stand(self) -> None:
        """Be without force and without a client, where it is; an event tells of one that was in force."""
        raise NotImplementedError

    def lose_client(self) -> None:
        """Know nothing of a client until it says something anew, and tell of one that was in force."""
        if self.state is _HELD:
            self._become(_STALE)
        self.forget()

    def forget(self) -> None:
        """Know nothing of a client until it says something anew."""
        self.state = PortState.IDLE
        self.seq = -1

    def pass_time(self, passed_s: float) -> None:
        """Grow older, and let go what is too old. What has come since the last tick is older by a period at most.

        Args:
            passed_s: time since the last tick on this computer's clock [s].
        """
        self._grow_old(min(passed_s, self._period_s) if self._new else passed_s)
        self._new = False
        self._keep_quiet(passed_s)
        if self.state is _HELD and (self.age_s > self.limits.hold_s or self._hangs(passed_s)):
            self._become(_STALE)

    def miss_time(self, passed_s: float) -> None:
        """Grow older by time that no tick counts [s]; what has come since the last tick came after it.

        One that is too old by then comes in with no force and lets none out.
        """
        if not self._new:
            self._grow_old(passed_s)
            if self.state is _HELD and self.age_s > self.limits.hold_s:
                self.stand()

    def _hear(self, update: Update, age_s: float) -> bool:
        """Take in what this kind of port goes by, said some time ago [s]; False when there is nothing of it yet."""
        raise NotImplementedError

    def _grow_old(self, passed_s: float) -> None:
        """Have what is known of the client be so much older [s]."""
        self.age_s += passed_s

    def _hangs(self, passed_s: float) -> bool:
        """Whether the client is to be believed no more though it speaks."""
        del passed_s
        return False

    @property
    def _waits_to_tell(self) -> bool:
        """Whether an event has to wait, or would if there were one now."""
        return self._stale_s < QUIET_S or self._back_s < QUIET_S

    def _keep_quiet(self, passed_s: float) -> None:
        """Tell what could not be told before, as soon as enough time has passed since the last event [s]."""
        self._stale_s += passed_s
        self._back_s += passed_s
        if self._silent is not self._told:
            self._tell()

    def _become(self, state: PortState) -> None:
        if state is not _HELD:
            self.seq = -1
        self.state = state
        self._silent = state is _STALE
        self._tell()

    def _tell(self) -> None:
        """Tell of a silence, or that one that was told has ended, where that is so now and it is not too soon."""
        if self.news is not None:  # the loop has yet to take that
            return
        if self._silent:
            if not self._told and self._stale_s >= QUIET_S:
                self.news = _STALE
                self._told = True
                self._stale_s = 0.0
        elif self._told and self.state is _HELD and self._back_s >= QUIET_S:
            self.news = _HELD
            self._told = False
            self._back_s = 0.0
