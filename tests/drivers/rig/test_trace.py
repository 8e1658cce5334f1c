"""The last messages between computer and rig, kept for a report from a machine that cannot be looked at."""

from __future__ import annotations

import pytest

from hapticd.errors import DriverError
from hapticd.trace import DriverTrace
from hapticd_drivers.rig import messages
from hapticd_drivers.rig.messages import State, decode
from hapticd_drivers.rig.serial_rig import SerialRig, SerialRigOptions
from hapticd_drivers.rig.traced_link import TracedLink
from tests.drivers.rig.device import Rig


def parts(driver: SerialRig) -> list[tuple[str, str]]:
    return [(way, said) for _, way, said in (line.split(" ", 2) for line in driver.trace.lines())]


def make(rig: Rig, trace: int) -> SerialRig:
    rig.set_home()
    options = {"port": str(rig.port), "sign_checked": True, "trace": trace}
    return SerialRig(SerialRigOptions.model_validate(options), 1e-3)


def test_every_message_is_kept_as_it_went_and_came(rig: Rig) -> None:
    driver = make(rig, 4096)
    driver.open()
    driver.enable()
    driver.write([1.25])
    driver.read()
    kept = parts(driver)
    assert kept[0][0] == ">"
    assert bytes.fromhex(kept[0][1])[1] == messages.HELLO
    forces = [bytes.fromhex(said) for way, said in kept if way == ">" and bytes.fromhex(said)[1] == messages.FORCE]
    assert [int.from_bytes(said[6:10], "little", signed=True) for said in forces] == [1_250_000]
    came = [decode(bytes.fromhex(said)) for way, said in kept if way == "<"]
    assert None not in came
    assert any(isinstance(said, State) for said in came)
    driver.close()


def test_it_is_of_bounded_size_and_stays_after_the_end(rig: Rig) -> None:
    driver = make(rig, 5)
    driver.open()
    for _ in range(20):
        driver.read()
    driver.close()
    assert len(driver.trace.lines()) == 5


def test_without_the_option_nothing_is_kept_and_no_message_costs_more(rig: Rig) -> None:
    driver = make(rig, 0)
    driver.open()
    driver.read()
    assert driver.trace.lines() == []
    assert not isinstance(driver._opened().link, TracedLink)
    driver.close()


class Worn:
    """A link that damages a frame, drops a message, and then is gone."""

    where = "worn"
    notes: tuple[str, ...] = ("old",)
    damaged = 0
    unsent = 0

    def send(self, message: bytes) -> None:
        if self.unsent:
            raise DriverError("gone")
        self.unsent = 1

    def receive(self) -> list[bytes]:
        if self.damaged:
            raise DriverError("gone")
        self.damaged = 2
        return []

    def wait(self, timeout_s: float) -> None: ...

    def close(self) -> None: ...


def test_what_the_link_could_not_carry_is_kept_as_well() -> None:
    trace = DriverTrace(100)
    link = TracedLink(Worn(), trace)
    assert (link.where, link.notes) == ("worn", ("old",))
    for use in (lambda: link.send(b"\1\2"), link.receive):
        use()
        with pytest.raises(DriverError):
            use()
    assert (link.damaged, link.unsent) == (2, 1)
    assert [line.split(" ", 1)[1] for line in trace.lines()] == [
        "> 01 02",
        "messages that the link took no more: 1",
        "> 01 02",
        "gone",
        "damaged frames: 2",
        "gone",
    ]
