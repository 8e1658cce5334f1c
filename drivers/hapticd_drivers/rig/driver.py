"""What the drivers of all rigs share: everything but the link (docs/rig-protocol.md)."""

from __future__ import annotations

import statistics
import threading
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, TypeVar

from hapticd.device import DeviceInfo, Sample
from hapticd.driver import Driver, DriverState
from hapticd.errors import (
    ConfigError,
    DeviceFaultError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverError,
    DriverStateError,
)
from hapticd.trace import DriverTrace
from hapticd_drivers.rig import messages, motion
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.link import Link
from hapticd_drivers.rig.mapping import AxisMap
from hapticd_drivers.rig.messages import ENABLED, HAS_HOME_SWITCH, HOMED, KNOWS_HOME, TRIPPED, Identity, State
from hapticd_drivers.rig.metrics import METRICS, ROUND_TRIP_US, TICKS_WITHOUT_STATE
from hapticd_drivers.rig.mover import RigMover
from hapticd_drivers.rig.options import AxisOptions, RigOptions
from hapticd_drivers.rig.sign import Sign
from hapticd_drivers.rig.traced_link import TracedLink

PATIENCE = 0.25
"""Share of the period for which a tick waits for a state that is late."""

ANSWER_AT = 0.8
"""Share of the period by which the answer to a command shall have come."""

SILENCE_S = 0.5
SILENT_TICKS = 20
"""So much time and so many ticks in a row without a state, and the rig counts as lost [s].

By then its force has long gone: the rig's watchdog has switched the motor off, and the loop has stopped for a frozen
device.
"""

MOST_UNANSWERED = 32
"""Questions on their way at once; a rig that is so far behind is asked only now and then, until it has caught up."""

COUNTS_EVERY_S = 1.0
"""How often the rig is asked what it has counted [s]."""

_PINGS = 15
_NAMES = ("x", "y", "z")
_INT_MODULUS = 1 << 32

RigOptionsT = TypeVar("RigOptionsT", bound=RigOptions)


class RigDriver(Driver[RigOptionsT]):
    """A rig behind a link; a driver of its own says how the link is opened."""

    METRICS = METRICS
    NAME: ClassVar[str]
    """What the configuration calls the driver."""

    def __init__(self, options: RigOptionsT, period_s: float) -> None:
        super().__init__(options, period_s)
        self._talk: Conversation | None = None
        self.trace = DriverTrace(options.trace)
        self._maps: list[AxisMap] = []
        self._sample = Sample(1)
        self._state_wait_s = PATIENCE * period_s
        self._answer_after_us = 0
        self._most_silent = max(SILENT_TICKS, round(SILENCE_S / period_s))
        self._silent = 0
        self._time_us = 0
        self._sequence = 0
        self._until_counts = 0
        self._button_bits = 0
        self._homed = False
        self._home_in_doubt = False  # it was told to the rig, and not that it has taken it
        self._sign = Sign(self.NAME, options.sign_checked)
        self._lock = threading.Lock()  # a calibration talks to the rig beside the loop
        self._knows_home = False

    @abstractmethod
    def _connect(self) -> Link:
        """Open the link.

        Raises:
            DriverError: not found, not permitted or busy.
        """

    def _check_link(self, identity: Identity) -> None:
        """Refuse what the link cannot carry.

        Raises:
            ConfigError: the rig's messages do not fit into a tick.
        """

    def _open(self) -> DeviceInfo:
        link = self._connect()
        if self.options.trace:
            link = TracedLink(link, self.trace)
        self._talk = talk = Conversation(link, self, self.NAME)
        identity = talk.greet()
        if not 1 <= identity.axes <= messages.MOST_AXES:
            raise DeviceProtocolError(f"{self.NAME}: the rig on {link.where} has {identity.axes} axes")
        self._check_link(identity)
        self._knows_home = bool(identity.capabilities & KNOWS_HOME)
        self._check_axes(identity)
        self._maps = [AxisMap(talk.describe(axis), self._axis_options(axis)) for axis in range(identity.axes)]
        round_trip_s = statistics.median(talk.round_trip_s() for _ in range(_PINGS))
        self.metrics[ROUND_TRIP_US] = 1e6 * round_trip_s
        if self.options.answer_after_us is None:
            self._answer_after_us = max(0, min(65535, round(1e6 * (ANSWER_AT * self.period_s - 1.25 * round_trip_s))))
        else:
            self._answer_after_us = self.options.answer_after_us
        self._sample = Sample(identity.axes)
        self._button_bits = (1 << min(identity.buttons, 16)) - 1
        self._silent = 0
        self._until_counts = round(COUNTS_EVERY_S / self.period_s)
        state = talk.state()
        if not state.flags & HOMED:
            for axis, count in zip(self._maps, state.position, strict=False):
                axis.put_middle(count)
        self._time_us = state.time_us
        self._sequence = state.sequence
        self._sample.time_ns = self._sample.sequence = 0
        self._accept(state)
        talk.poll(self._answer_after_us)
        return self._described(identity, link, round_trip_s)

    def _described(self, identity: Identity, link: Link, round_trip_s: float) -> DeviceInfo:
        options = self.options
        limit_n = min(axis.max_force_n for axis in self._maps)
        max_force_n = limit_n if options.max_force_n is None else options.max_force_n
        if max_force_n > limit_n:
            raise ConfigError(
                f"device.options.max_force_n = {max_force_n:g}: this rig's handle takes at most {limit_n:g} N"
            )
        notes = list(link.notes)
        if round_trip_s > self.period_s:
            notes.append(
                f"{self.NAME}: the rig on {link.where} takes {1e3 * round_trip_s:.1f} ms to answer, a tick is "
                f"{1e3 * self.period_s:g} ms: a wall feels soft and shakes early (docs/serial-rig.md)"
            )
        return DeviceInfo(
            model=identity.model or "rig",
            serial=identity.serial,
            axes=_NAMES[: identity.axes],
            max_force_n=max_force_n,
            resolution_m=max(abs(axis.count_m) for axis in self._maps),
            workspace_m=tuple((axis.lowest_m, axis.highest_m) for axis in self._maps),
            nominal_rate_hz=float(identity.nominal_rate_hz) or 1.0 / self.period_s,
            # A damper on the difference of two samples, three samples late, is stable below 0.40 m / T.
            safe_damping_n_s_per_m=0.2 * options.moving_mass_kg / self.period_s,
            host_silence_ms=float(identity.host_silence_ms) or None,
            buttons=identity.buttons,
            has_clock=True,
            has_sequence=True,
            notes=tuple(notes),
        )

    def _check_axes(self, identity: Identity) -> None:
        tables = self.options.axes
        if len(tables) > identity.axes:
            raise ConfigError(f"device.options.axes: {len(tables)} tables, and this rig has {identity.axes} axes")
        if not identity.capabilities & HAS_HOME_SWITCH:
            for index, table in enumerate(tables):
                if table.homing.endswith("switch"):
                    raise ConfigError(
                        f'device.options.axes[{index}].homing = "{table.homing}": this rig has no home switch'
                    )

    def _axis_options(self, axis: int) -> AxisOptions:
        tables = self.options.axes
        return tables[axis] if axis < len(tables) else AxisOptions()

    def _enable(self) -> None:
        if not self._homed:
            raise DriverStateError(
                f"{self.NAME}: the rig does not know where it is since it was switched on: clear its workspace, then "
                "`hapticd calibrate`, which moves the arm"
            )
        self._sign.demand()
        with self._lock:
            state = self._let_forces_through(urgent=True)
            if not state.flags & HOMED:
                self._opened().disable(urgent=True)
                self._homed = False
                raise DriverStateError(f"{self.NAME}: the rig has just lost its home: `hapticd calibrate`")

    def _let_forces_through(self, urgent: bool) -> State:
        talk = self._opened()
        talk.disable(urgent)  # clears a fault whose cause is gone
        state = talk.enable(urgent)
        if not state.flags & ENABLED:
            raise self._stopped(state)
        self._silent = 0
        return state

    def _read(self) -> Sample:
        if not self._lock.acquire(False):
            return self._sample  # a calibration keeps it fresh meanwhile
        try:
            talk = self._talk
            assert talk is not None
            # Nothing comes unless somebody has asked.
            state = talk.await_state(self._state_wait_s) if talk.unanswered else talk.newest()
            if state is not None:
                self._silent = 0
                self._accept(state)
                if self.state is _ENABLED and not state.flags & ENABLED:
                    raise self._stopped(state)
            elif talk.unanswered:
                self._bear_silence(talk)
            if self.state is not _ENABLED and (
                talk.unanswered < MOST_UNANSWERED or self._silent % MOST_UNANSWERED == 0
            ):
                talk.poll(self._answer_after_us)
            self._until_counts -= 1
            if self._until_counts <= 0:
                self._until_counts = round(COUNTS_EVERY_S / self.period_s)
                talk.ping()
            return self._sample
        finally:
            self._lock.release()

    def _write(self, force_n: Sequence[float]) -> None:
        talk = self._talk
        assert talk is not None
        talk.push(self._answer_after_us, [axis.force_un(n) for axis, n in zip(self._maps, force_n, strict=True)])

    def _disable(self) -> None:
        talk = self._talk
        if talk is None:
            return
        if not self._lock.acquire(timeout=1.0):
            raise DeviceTimeoutError(f"{self.NAME}: a calibration that was called off has not ended within 1 s")
        try:
            talk.disable(urgent=True)
        finally:
            self._lock.release()

    def _close(self) -> None:
        talk, self._talk = self._talk, None
        if talk is not None:
            talk.link.close()

    def _accept(self, state: State) -> None:
        """Fill the sample in."""
        if len(state.position) != len(self._maps):
            raise DeviceProtocolError(
                f"{self.NAME}: the rig sends {len(state.position)} axes, and has said that it has {len(self._maps)}"
            )
        sample = self._sample
        sample.time_ns += 1000 * ((state.time_us - self._time_us) % _INT_MODULUS)
        sample.sequence += state.sequence - self._sequence & 0xFFFF
        self._time_us = state.time_us
        self._sequence = state.sequence
        sample.buttons = state.buttons & self._button_bits
        # A rig that has lost counts forgets its home.
        self._homed = bool(state.flags & HOMED) and not self._home_in_doubt
        sample.calibrated = self._homed and self._sign.checked
        position_m = sample.position_m
        for index, axis in enumerate(self._maps):
            position_m[index] = axis.position_m(state.position[index])

    def _bear_silence(self, talk: Conversation) -> None:
        self.metrics[TICKS_WITHOUT_STATE] += 1.0
        self._silent += 1
        if self._silent >= self._most_silent:
            raise DeviceTimeoutError(
                f"{self.NAME}: the rig on {talk.link.where} has not answered for {self._silent} ticks: is it "
                "unplugged, or without power?"
            )

    def _stopped(self, state: State) -> DriverError:
        """Why the rig lets no forces through."""
        talk = self._opened()
        if state.fault:
            why = messages.fault_text(state.fault)
            told = talk.fault
            if told is not None and told.fault == state.fault:
                where = "" if told.axis == messages.NO_AXIS else f"axis {told.axis}, "
                why += f" ({where}detail {told.detail})"
        elif state.flags & TRIPPED:
            why = f"its watchdog heard no command for {self.info.host_silence_ms:g} ms"
        else:
            why = "it does not say why"
        return DeviceFaultError(f"{self.NAME}: the rig has switched its motor off: {why}")

    def _calibrate(self) -> None:
        with self._lock:
            talk = self._opened()
            mover = RigMover(talk, self._maps, self._accept, self._stopped, lambda: self._called_off, self.period_s)
            try:
                self._let_forces_through(urgent=False)
                homes = [self._calibrated(mover, axis) for axis in range(len(self._maps))]
                mover.push(0, 0.0)
                # All this before the motor is off: the message that switches it off clears a fault as well, and counts
                # that were lost on the way here would be forgotten with it.
                for index, home in enumerate(homes):
                    if home is not None:
                        self._home_in_doubt = True
                        talk.set_home(index, home)
                        self._maps[index].put_home(home)
                state = talk.state()
                if state.fault:  # of its sensor, perhaps: what it has counted since is not known
                    self._home_in_doubt = True
                    raise self._stopped(state)
            finally:
                talk.disable(urgent=False)
            state = talk.state()
            if not state.flags & HOMED:
                raise DeviceFaultError(f"{self.NAME}: the rig has just lost its home: calibrate once more")
            self._home_in_doubt = False
            self._sign.checked = True
            self._accept(state)
            talk.poll(self._answer_after_us)

    def _calibrated(self, mover: RigMover, index: int) -> int | None:
        """Check one axis and find its home; None when the rig knows that itself."""
        axis = self._maps[index]
        options = self.options
        force_n = min(options.calibration_force_n, axis.max_force_n, self.info.max_force_n)
        speed_m_per_s = options.calibration_speed_m_per_s
        drive = motion.Drive(
            mover=mover,
            axis=index,
            name=_NAMES[index],
            force_n=force_n,
            speed_m_per_s=speed_m_per_s,
            damping_n_s_per_m=min(0.1 * options.moving_mass_kg / self.period_s, 0.2 * force_n / speed_m_per_s),
            count_m=abs(axis.count_m),
            span_m=axis.highest_m - axis.lowest_m,
        )
        self._sign.check(drive)
        if self._knows_home:
            return None
        match self._axis_options(index).homing:
            case "here":
                return motion.here(drive)
            case "low_stop":
                return axis.home_if(motion.find_stop(drive, -1.0), axis.lowest_m)
            case "high_stop":
                return axis.home_if(motion.find_stop(drive, 1.0), axis.highest_m)
            case "low_switch":
                return axis.home_if(motion.find_switch(drive, -1.0), axis.lowest_m)
            case "high_switch":
                return axis.home_if(motion.find_switch(drive, 1.0), axis.highest_m)

    def _opened(self) -> Conversation:
        assert self._talk is not None
        return self._talk


_ENABLED = DriverState.ENABLED  # Python 3.11 takes 0.1 us to look a member up, each time
