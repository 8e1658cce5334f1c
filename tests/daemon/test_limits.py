"""The force limit that the status names is the one that the guard keeps."""

from __future__ import annotations

import pytest

from hapticd.tick.event import EventCode
from tests.daemon.running import Daemon, Subscriber
from tests.faults.rig import Rig, anew_where_late, events_until


@pytest.mark.parametrize(
    ("safety", "limit_n"),
    [
        ("max_axis_force_n = 5.0", 5.0),
        ("max_force_n = 7.0\nmax_axis_force_n = 9.0", 7.0),
        ('profile = "simulation"', 12.0),
        ('profile = "simulation"\n[device.options]\nmax_force_n = 0.0', 0.0),
    ],
)
def test_the_status_names_the_smallest_limit_that_holds(safety: str, limit_n: float) -> None:
    with Daemon(f"[safety]\n{safety}\n") as daemon, Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        assert subscriber.until("hapticd/status")["max_force_n"] == limit_n


@anew_where_late
def test_a_limit_that_the_lost_device_cannot_have_does_not_end_the_daemon() -> None:
    with Rig() as rig, rig.subscriber() as subscriber:
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        rig.daemon.config.write_text(rig.config.replace("[safety]", "[safety]\nmax_force_n = 50.0"))
        assert rig.ask("reload", wait=True)["ok"]
        rig.mend()
        for topic, fields in subscriber.maps():
            if topic == "hapticd/status" and "takes at most 12 N" in str(fields["warnings"]):
                assert fields["max_force_n"] == 12.0
                return
    raise AssertionError("nobody said why the device is not taken back")
