"""What a tick costs is measured on the drivers' real way; how much it is stands in the docs and in no test."""

from __future__ import annotations

import pytest

from tests.drivers.motors.cost import lines, measure


@pytest.mark.nightly
def test_every_driver_is_measured_beside_the_simulated_device() -> None:
    found = measure(60)
    assert [body.name for body in found.bodies] == [
        "arithmetic",
        "loopback",
        "moteus, 1",
        "moteus, 3",
        "odrive, 1",
        "inverse3",
    ]
    assert sum(line.startswith("device") for line in lines(found)) == 5
