"""The thread that carries messages beside a real-time loop."""

from __future__ import annotations

import os

from hapticd_drivers.haply.courier import Courier
from hapticd_drivers.haply.messages import question
from hapticd_drivers.scheduling import LOOK_EVERY_TICKS
from tests.drivers.haply.service import FakeService


def test_it_is_scheduled_as_the_one_that_sends() -> None:
    """Else a busy computer keeps it from its work, and the loop takes the device for frozen."""
    with FakeService() as service:
        courier = Courier(service.url)
        before = os.sched_getscheduler(0)
        try:
            assert courier.native_id is not None
            courier.send(question(service.device))  # as while a device is opened
            assert os.sched_getscheduler(courier.native_id) == before
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
            for _ in range(LOOK_EVERY_TICKS + 1):
                courier.send(question(service.device))
            assert os.sched_getscheduler(courier.native_id) == os.SCHED_BATCH
        finally:
            os.sched_setscheduler(0, before, os.sched_param(0))
            courier.end()
