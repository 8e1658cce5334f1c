"""Moves a rig for a calibration: a force out, the next state in, once a tick."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from hapticd.errors import DeviceTimeoutError, DriverError, DriverStateError
from hapticd_drivers.rig.conversation import Conversation
from hapticd_drivers.rig.mapping import AxisMap
from hapticd_drivers.rig.messages import ENABLED, HOME_SWITCH_CLOSED, State
from hapticd_drivers.rig.motion import Moment

MOST_TRIPS = 10
"""So often may the rig's watchdog trip meanwhile: a calibration is no real-time program, and each trip is harmless."""

ANSWER_S = 0.05
MOST_MISSES = 10
"""A state is waited for so long, and may be missing so often in a row [s]."""


class RigMover:
    """A `motion.Mover` on a rig whose motor is enabled.

    Args:
        talk: the rig.
        maps: its axes.
        accept: is given each state.
        stopped: says why the rig has switched its motor off.
        called_off: whether the calibration shall end.
        period_s: time between two forces [s].
    """

    def __init__(
        self,
        talk: Conversation,
        maps: Sequence[AxisMap],
        accept: Callable[[State], None],
        stopped: Callable[[State], DriverError],
        called_off: Callable[[], bool],
        period_s: float,
    ) -> None:
        self._talk = talk
        self._maps = maps
        self._accept = accept
        self._stopped = stopped
        self._called_off = called_off
        self._period_s = period_s
        self._due_s = time.monotonic()
        self._time_us: int | None = None
        self._device_s = 0.0
        self._trips = 0

    def push(self, axis: int, force_n: float) -> Moment:
        """Set the force on one axis, none on the others, and say where it is a tick later.

        Raises:
            DriverError: called off, or the rig stopped, is silent or is gone.
        """
        state = self._next_state(
            [each.force_un(force_n) if index == axis else 0 for index, each in enumerate(self._maps)]
        )
        self._accept(state)
        count = state.position[axis]
        return Moment(self._device_s, self._maps[axis].position_m(count), count, bool(state.flags & HOME_SWITCH_CLOSED))

    def _next_state(self, force_un: list[int]) -> State:
        """A state that is newer than the last one, by the rig's own clock."""
        talk = self._talk
        for _ in range(MOST_MISSES):
            if self._called_off():
                raise DriverStateError("called off")
            talk.push(0, force_un)
            self._due_s = max(self._due_s + self._period_s, time.monotonic())
            time.sleep(max(0.0, self._due_s - time.monotonic()))
            state = talk.await_state(ANSWER_S)
            if state is None or state.time_us == self._time_us:
                continue
            if not state.flags & ENABLED:
                self._trips += 1
                if state.fault or self._trips > MOST_TRIPS:
                    raise self._stopped(state)
                talk.enable(urgent=False)
                continue
            if self._time_us is not None:
                self._device_s += 1e-6 * (state.time_us - self._time_us & 0xFFFFFFFF)
            self._time_us = state.time_us
            return state
        raise DeviceTimeoutError("the rig has not answered in time during its calibration")
