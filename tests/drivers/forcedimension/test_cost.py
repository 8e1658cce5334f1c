"""What a tick costs is measured on the driver's real calls; how much it is stands in docs/omega7.md and in no test."""

from __future__ import annotations

from tests.drivers.forcedimension.cost import lines, measure

ATTEMPTS = 5


def test_the_driver_is_measured_whole_and_in_pieces() -> None:
    for _ in range(ATTEMPTS):
        found = measure(60)
        # A computer that is away for 50 ms stops any real device's loop.
        if not any("deadlines were missed" in body.problem for body in found.bodies):
            break
    assert [(body.group, body.name, body.problem) for body in found.bodies] == [
        ("reference", "arithmetic", ""),
        ("device", "loopback", ""),
        ("device", "omega7", ""),
    ]
    assert [piece.name for piece in found.pieces] == ["nothing", "read", "step", "write", "record"]
    assert any(line.startswith("device omega7") for line in lines(found))
