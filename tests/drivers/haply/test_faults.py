"""Each thing that can go wrong with the Inverse service: how soon it is noticed, its name, and what push is left."""

from __future__ import annotations

import asyncio
import json
import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticd.errors import (
    DeviceBusyError,
    DeviceDisconnectedError,
    DeviceNotFoundError,
    DeviceProtocolError,
    DeviceTimeoutError,
    DriverError,
)
from hapticd_drivers.haply import driver as haply_driver
from hapticd_drivers.haply import messages
from hapticd_drivers.haply.driver import BAD, Inverse3, Inverse3Options
from tests.drivers.haply.service import FakeService
from tests.drivers.trouble import Trouble
from tests.examples import examples

PUSH_N = 1.0
PAGE = Path(__file__).parents[3] / "docs" / "inverse3.md"


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeService]:
    monkeypatch.setattr(haply_driver, "URGENT_S", 5.0)
    with FakeService() as made:
        yield made


def opened(service: FakeService, **keys: Any) -> Inverse3:
    driver = Inverse3(Inverse3Options.model_validate({"url": service.url, **keys}), 0.001)
    driver._state_wait_s = 1.0  # a busy computer is no fault
    driver.open()
    return driver


def pressing(service: FakeService) -> Inverse3:
    driver = opened(service)
    driver.enable()
    for _ in range(10):
        driver.read()
        driver.write([0.0, 0.0, PUSH_N])
    driver.read()
    return driver


def ticks_until(driver: Inverse3, kind: type[DriverError], text: str, tick_s: float) -> int:
    driver._state_wait_s = tick_s
    ticks = 0

    def press_on() -> None:
        nonlocal ticks
        while ticks < 2000:
            ticks += 1
            driver.read()
            driver.write([0.0, 0.0, PUSH_N])

    with pytest.raises(kind, match=text):
        press_on()
    return ticks


def unplug(service: FakeService) -> None:
    with service.lock:
        service.device = ""


def fall_silent(service: FakeService) -> None:
    with service.lock:
        service.mute = True


FAULTS = (
    Trouble("the service ends", FakeService.stop, DeviceDisconnectedError, "is gone", 2, 0.0),
    Trouble("the device is unplugged", unplug, DeviceDisconnectedError, "no more", 2, 0.0),
    Trouble(
        "the service is silent", fall_silent, DeviceTimeoutError, "has said nothing for 500 ticks", 501, PUSH_N, 0.001
    ),
)


@pytest.mark.parametrize("trouble", FAULTS, ids=lambda trouble: trouble.name)
def test_what_goes_wrong_is_named_and_no_more_force_is_asked_for(
    service: FakeService, trouble: Trouble, record_property: Callable[[str, object], None]
) -> None:
    driver = pressing(service)
    service.peak_n = 0.0
    trouble.happen(service)
    ticks = ticks_until(driver, trouble.kind, trouble.text, trouble.tick_s)
    record_property("ticks", ticks)
    record_property("peak_n", service.peak_n)
    assert ticks <= trouble.most_ticks
    assert service.peak_n == pytest.approx(trouble.peak_n)
    driver.close()
    assert driver.force_left
    assert trouble.row() in PAGE.read_text()


def test_disable_and_close_leave_a_force_of_zero(service: FakeService) -> None:
    driver = pressing(service)
    assert service.cursor.force_n == [0.0, 0.0, PUSH_N]
    driver.disable()
    assert service.cursor.force_n == [0.0, 0.0, 0.0]
    driver.enable()
    driver.write([0.0, 0.0, PUSH_N])
    driver.close()
    assert service.cursor.force_n == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("end", [Inverse3.disable, Inverse3.close], ids=["disable", "close"])
def test_the_answer_to_the_force_before_is_none_to_the_zero(
    service: FakeService, monkeypatch: pytest.MonkeyPatch, end: Callable[[Inverse3], None]
) -> None:
    """A service that answered it late and then hung was believed to have let go."""
    driver = pressing(service)
    monkeypatch.setattr(haply_driver, "URGENT_S", 0.5)
    obey = service._obey
    heard, goes_on = threading.Event(), threading.Event()

    def late(said: dict[str, Any]) -> None:
        if heard.is_set():
            goes_on.wait(10.0)
        obey(said)
        heard.set()
        time.sleep(0.05)

    monkeypatch.setattr(service, "_obey", late)
    driver.write([0.0, 0.0, PUSH_N])
    assert heard.wait(10.0)
    end(driver)
    assert service.cursor.force_n == [0.0, 0.0, PUSH_N]
    assert "did not answer" in driver.force_left
    goes_on.set()
    driver.close()


def press_and_hear_unasked(service: FakeService, driver: Inverse3, unasked: int) -> None:
    """A force, its answer, and states that lie unread then."""
    courier = driver._opened()
    exchanges = courier.exchanges
    service.unasked = unasked
    driver.write([0.0, 0.0, PUSH_N])
    end_s = time.monotonic() + 30.0
    while courier.exchanges == exchanges or service.unasked:
        assert time.monotonic() < end_s
        time.sleep(0.001)
    with service.lock:
        pass  # all have been sent
    asyncio.run_coroutine_threadsafe(asyncio.sleep(0.05), courier._loop).result(30.0)  # and have come


@pytest.mark.parametrize("end", [Inverse3.disable, Inverse3.close], ids=["disable", "close"])
def test_a_state_that_came_unasked_is_no_answer_to_the_zero(
    service: FakeService, monkeypatch: pytest.MonkeyPatch, end: Callable[[Inverse3], None]
) -> None:
    driver = pressing(service)
    monkeypatch.setattr(haply_driver, "URGENT_S", 0.5)
    press_and_hear_unasked(service, driver, 1)
    obey, goes_on = service._obey, threading.Event()

    def late(said: dict[str, Any]) -> None:
        goes_on.wait(10.0)
        obey(said)

    monkeypatch.setattr(service, "_obey", late)
    end(driver)
    assert service.cursor.force_n == [0.0, 0.0, PUSH_N]
    assert "did not answer" in driver.force_left
    goes_on.set()
    driver.close()


def test_states_that_came_unasked_make_no_later_one_older(service: FakeService) -> None:
    driver = pressing(service)
    for _ in range(3):
        press_and_hear_unasked(service, driver, 2)
    driver.read()
    press_and_hear_unasked(service, driver, 0)
    assert driver.read().position_m == pytest.approx(service.cursor.x_m, abs=0.0, rel=0.0)
    driver.close()


def test_a_second_program_is_refused_the_same_device_until_the_first_has_closed_it(service: FakeService) -> None:
    """The service lets any number of clients in, and a second one's zero force would take the first one's away."""
    first = pressing(service)
    second = Inverse3(Inverse3Options(url=service.url.replace("127.0.0.1", "localhost")), 0.001)
    with pytest.raises(DeviceBusyError, match=r"has 049D of the service at port [0-9]+: end it first"):
        second.open()
    assert service.cursor.force_n == [0.0, 0.0, PUSH_N]
    first.close()
    second.open()
    second.close()


def test_one_message_a_force_and_one_state_a_message(service: FakeService) -> None:
    """Nothing is sent that no tick has asked for, and no state comes unasked."""
    driver = pressing(service)
    before, sequence = service.messages, driver.read().sequence
    for _ in range(50):
        driver.write([0.0, 0.1, 0.0])
        driver.read()
    assert service.messages == before + 50
    assert driver.read().sequence == sequence + 50
    driver.close()


HUGE = f'{{"x": 1{400 * "0"}, "y": 0, "z": 0}}'
"""A number in JSON may have any length, and no float may have this one."""


@pytest.mark.parametrize(
    "spoilt",
    [
        *("", "no JSON", "[]", '{"inverse3": 5}', '{"inverse3":[{"device_id":"049D"}]}', "NaN"),
        f'{{"inverse3":[{{"device_id":"049D","state":{{"cursor_position":{HUGE},"cursor_velocity":{HUGE}}}}}]}}',
    ],
    ids=["empty", "no JSON", "a list", "no devices", "no state", "NaN", "a huge number"],
)
def test_a_message_that_makes_no_sense_is_counted_and_not_believed(service: FakeService, spoilt: str) -> None:
    driver = pressing(service)
    x_m = list(driver.read().position_m)
    service.spoil.append(spoilt)
    driver.write([0.0, 0.0, 0.0])
    driver._state_wait_s = 0.05
    end_s = time.monotonic() + 30.0
    while not driver.metrics[BAD] and time.monotonic() < end_s:
        assert driver.read().position_m == pytest.approx(x_m, abs=1e-3)
    assert driver.metrics[BAD] == 1
    driver.close()


def test_a_service_that_answers_nonsense_is_not_said_to_be_silent(service: FakeService) -> None:
    """Such as the orientation of a grip that is none: the advice was to look for what overloads the service."""
    service.spoil.append('{"inverse3":[{"device_id":"049D"}]}')
    with pytest.raises(DeviceProtocolError, match="makes no sense: a device without a state"):
        opened(service)


def test_a_place_that_is_no_number_is_no_place(service: FakeService) -> None:
    driver = pressing(service)
    service.cursor.x_m[0] = math.nan  # Python writes NaN into JSON
    driver.write([0.0, 0.0, 0.0])
    driver._state_wait_s = 0.05
    end_s = time.monotonic() + 30.0
    while not driver.metrics[BAD] and time.monotonic() < end_s:
        assert all(map(math.isfinite, driver.read().position_m))
    assert driver.metrics[BAD] == 1
    driver.close()


def test_grip_orientation_and_buttons_are_there(service: FakeService) -> None:
    driver = opened(service)
    sample = driver.read()
    assert sample.orientation == pytest.approx([0, -1, 0, 1, 0, 0, 0, 0, 1], abs=1e-12)  # a quarter turn about z
    assert sample.buttons == 0b010
    driver.close()


@pytest.mark.parametrize("key", ["vector", "values"])
def test_either_name_of_a_force_arrives_where_the_service_knows_it(service: FakeService, key: str) -> None:
    service.accepts = (key,)
    driver = opened(service, force_key=key)
    driver.enable()
    driver.write([0.5, 0.0, 0.0])
    driver.read()
    end_s = time.monotonic() + 30.0
    while service.cursor.force_n != [0.5, 0.0, 0.0]:
        assert time.monotonic() < end_s
        time.sleep(0.001)
    driver.close()


def test_without_a_service_or_a_device_it_says_what_to_do(service: FakeService) -> None:
    with pytest.raises(DeviceNotFoundError, match="049D"):
        opened(service, device="0000")
    service.device = ""
    with pytest.raises(DeviceNotFoundError, match="lists none"):
        opened(service)
    assert Inverse3.find(Inverse3Options(url=service.url)) == []
    service.stop()
    with pytest.raises(DeviceNotFoundError, match="install and start it"):
        opened(service)
    assert Inverse3.find(Inverse3Options(url=service.url)) == []


def test_it_is_found_where_the_service_runs(service: FakeService) -> None:
    (found,) = Inverse3.find(Inverse3Options(url=service.url))
    assert (found.serial, found.where) == ("049D", service.url)
    assert service.messages == 0


def test_the_doctor_hears_what_the_service_lists_and_what_to_do_without_one(service: FakeService) -> None:
    options = Inverse3Options(url=service.url)
    (well,) = Inverse3.diagnose(options)
    assert (well.mark, "lists 049D" in well.text) == ("ok", True)
    service.device = ""
    (none,) = Inverse3.diagnose(options)
    assert (none.mark, "lists no Inverse3" in none.text) == ("ok", True)
    service.stop()
    (gone,) = Inverse3.diagnose(options)
    assert (gone.mark, "no Haply Inverse service" in gone.text) == ("problem", True)
    assert "docs/inverse3.md" in gone.mend[0]


def test_the_doctor_hears_when_it_is_not_clear_which_device_is_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    with FakeService() as service:
        monkeypatch.setattr(messages, "devices", lambda _: ["049D", "04A1"])
        _, unclear = Inverse3.diagnose(Inverse3Options(url=service.url))
        assert unclear.mark == "problem"
        assert len(Inverse3.diagnose(Inverse3Options(url=service.url, device="04A1"))) == 1


@examples(300)
@given(
    force_n=st.tuples(*[st.floats(-10, 10)] * 3), device=st.text(max_size=20), key=st.sampled_from(["vector", "values"])
)
def test_what_is_sent_is_the_json_of_the_public_pages(
    force_n: tuple[float, float, float], device: str, key: str
) -> None:
    said = json.loads(messages.force(device, key, force_n))
    commands = {"set_cursor_force": {key: dict(zip("xyz", force_n, strict=True))}}
    assert said == {"inverse3": [{"device_id": device, "commands": commands}]}
    asked = json.loads(messages.question(device))
    assert asked == {"inverse3": [{"device_id": device, "commands": {"probe_position": {}}}]}


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(
                ["inverse3", "device_id", "state", "cursor_position", "x", "y", "z", "wireless_verse_grip"]
            ),
            inner,
            max_size=4,
        ),
    ),
    max_leaves=12,
)


@examples(300)
@given(said=st.one_of(JSON.map(json.dumps), st.text(max_size=60)))
def test_whatever_the_service_says_it_is_a_state_or_refused(said: str) -> None:
    for read in (lambda: messages.devices(said), lambda: messages.state(said, "049D")):
        try:
            found = read()
        except ValueError:
            continue
        if isinstance(found, messages.State):
            assert all(map(math.isfinite, [*found.position_m, *found.velocity_m_per_s, *found.orientation]))
