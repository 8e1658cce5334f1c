"""docs/rig-protocol.md, the core's header and the drivers' codec number the same things alike."""

from __future__ import annotations

import re

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.frames import framed
from tests.firmware.tools import FIRMWARE

PAGE = (FIRMWARE.parents[1] / "docs" / "rig-protocol.md").read_text()
HEADER = (FIRMWARE / "protocol" / "message.h").read_text()


def test_types_have_the_numbers_that_the_page_gives_them() -> None:
    on_page = {name: int(code, 16) for code, name in re.findall(r"^\| (0x\w\w) \| (\w+) \|", PAGE, re.M)}
    in_core = {name: int(code, 16) for name, code in re.findall(r"RIG_(\w+) = (0x\w\w),", HEADER)}
    assert len(on_page) == 14
    assert on_page == in_core
    assert on_page == {name: getattr(messages, name) for name in on_page}


def test_lengths_are_those_of_the_page() -> None:
    words = re.search(r"Lengths with header and CRC: (.*?)\.\n", PAGE, re.S)
    assert words is not None
    lengths = " ".join(words[1].split())
    assert (
        f"STATE 16 + 8 × axes, PONG 26, FAULT 18, REFUSED 14; HELLO, ENABLE and DISABLE {len(messages.hello(0))}"
        in lengths
    )
    assert f"DESCRIBE {len(messages.describe(0, 0))}, SET_HOME {len(messages.set_home(0, 0, 0))}" in lengths
    assert f"POLL {len(messages.poll(0, 0))}, FORCE 8 + 4 × axes, PING {len(messages.ping(0, 0))}" in lengths
    assert [len(messages.force(0, 0, [0] * axes)) for axes in (1, 2, 3)] == [12, 16, 20]


def test_the_bytes_of_the_conversation_are_real() -> None:
    shown = re.search(r"HELLO  seq 100 +((?:[0-9a-f]{2} ?)+)\n", PAGE)
    assert shown is not None
    assert bytes.fromhex(shown[1]) == framed(messages.hello(100))
