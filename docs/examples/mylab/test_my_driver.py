"""The driver proves itself on a fake of the device: what every driver must keep, then what this one is for."""

import pytest
import serial

from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError
from hapticd.testing import DriverContract
from mylab.my_driver import MyRig, MyRigOptions


class FakeRig:
    """The device at the other end of the line, in the place of `serial.Serial`."""

    def __init__(self, port, baud, timeout, write_timeout):
        if port != "/dev/fake":
            raise serial.SerialException("no such port")
        self.enabled = False
        self.force_n = 0.0
        self.counts = 120
        self.plugged_in = True
        self._answer = b""

    def write(self, line):
        if not self.plugged_in:
            raise serial.SerialException("unplugged")
        command, _, value = line.decode().strip().partition(" ")
        if command == "hello":
            self._answer = b"my-rig 0042\n"
        elif command == "position":
            self._answer = b"%d\n" % self.counts
        elif command == "force":
            self.force_n = int(value) / 1000.0
        elif command in ("enable", "disable"):
            self.enabled = command == "enable"
            self.force_n = 0.0

    def readline(self):
        answer, self._answer = self._answer, b""
        return answer

    def close(self):
        pass


@pytest.fixture
def rig(monkeypatch):
    monkeypatch.setattr(serial, "Serial", FakeRig)
    return MyRig(MyRigOptions(port="/dev/fake"), period_s=0.001)


class TestMyRig(DriverContract):
    @pytest.fixture
    def driver(self, rig):
        return rig

    def force_on_device(self, driver):
        fake = driver._board._line
        return [fake.force_n if fake.enabled else 0.0]


def test_a_position_is_in_metres(rig):
    with rig:
        assert rig.read().position_m == [0.0012]


def test_a_rig_that_is_not_there_says_what_to_do(monkeypatch):
    monkeypatch.setattr(serial, "Serial", FakeRig)
    with pytest.raises(DeviceNotFoundError, match="plugged in"):
        MyRig(MyRigOptions(port="/dev/nothing"), period_s=0.001).open()


def test_a_rig_that_is_unplugged_is_an_error_and_not_a_force(rig):
    with rig:
        rig._board._line.plugged_in = False
        with pytest.raises(DeviceDisconnectedError):
            rig.read()
