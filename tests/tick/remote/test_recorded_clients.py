"""Whatever clients talk of, the device and they themselves get at every tick what they got before."""

from __future__ import annotations

import pytest

from tests.recorded.check import check
from tests.recorded.clients import HEARD


@pytest.mark.parametrize("name", HEARD)
def test_what_clients_bring_about_is_as_it_was_written_down(name: str) -> None:
    check(name)
