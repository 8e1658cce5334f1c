"""Moves the handle for a calibration: a force out, the next states in, once a tick."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from hapticd.errors import DeviceTimeoutError, DriverStateError
from hapticd_drivers.motors.crew import RESTARTED_S, Crew
from hapticd_drivers.motors.drum import Drum
from hapticd_drivers.rig.motion import Moment

COUNTS_PER_TURN = 1 << 20
"""Resolution of the places that a movement is given: finer than any encoder."""

MOST_TRIPS = 10
"""So often may the watchdog trip, or a state be lost, since a calibration is no real-time program."""


class MotorMover:
    """A `motion.Mover` on motors that are enabled.

    Args:
        crew: the motors.
        drums: their axes.
        accept: called after each state.
        called_off: whether the calibration is to end.
        period_s: time between two forces [s].
    """

    def __init__(
        self,
        crew: Crew,
        drums: Sequence[Drum],
        accept: Callable[[], None],
        called_off: Callable[[], bool],
        period_s: float,
    ) -> None:
        self._crew = crew
        self._drums = drums
        self._accept = accept
        self._called_off = called_off
        self._period_s = period_s
        self._started_s = self._due_s = time.monotonic()
        self._trips = 0

    def push(self, axis: int, force_n: float) -> Moment:
        """Set the force on one axis, none on the others, and say where it is a tick later.

        There is none before all motors follow: what was asked for meanwhile would come in one step.

        Raises:
            DriverError: called off, or a motor stopped, is silent or is gone.
        """
        crew = self._crew
        torques = [drum.torque_n_m(force_n) if index == axis else 0.0 for index, drum in enumerate(self._drums)]
        while True:
            if self._called_off():
                raise DriverStateError("called off")
            follow = crew.follow()
            crew.push(torques if follow else [0.0] * len(torques))
            self._due_s = max(self._due_s + self._period_s, time.monotonic())
            time.sleep(max(0.0, self._due_s - time.monotonic()))
            if crew.await_states(RESTARTED_S):
                crew.note()
                problem = crew.problem()
                if problem is None:
                    if follow:
                        break
                    continue
            else:
                problem = DeviceTimeoutError(
                    f"a motor on {crew.link.where} has said nothing for {1e3 * RESTARTED_S:g} ms during the "
                    "calibration: was it switched off and on, or is its cable loose?"
                )
                if not crew.REMEMBERS:  # its silence is all that shows that it may count from elsewhere
                    raise problem
            self._trips += 1
            if self._trips > MOST_TRIPS:
                raise problem
            crew.enable()
        self._accept()
        turns = crew.motors[axis].turns
        return Moment(
            time.monotonic() - self._started_s,
            self._drums[axis].position_m(turns),
            round(turns * COUNTS_PER_TURN),
            False,
        )
