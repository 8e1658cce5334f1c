"""The fake SDK, built once a session; each test has devices of its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd_drivers.forcedimension import discovery
from tests.drivers.forcedimension.bench import Bench
from tests.drivers.forcedimension.building import build


@pytest.fixture(scope="session")
def fake_sdk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("sdk"))


@pytest.fixture
def bench(fake_sdk: Path) -> Iterator[Bench]:
    made = Bench(fake_sdk)
    discovery._in_use.clear()  # what a test that failed has left open
    yield made
    assert not made.expert()
    assert sum(made.get("misuse", device) for device in range(4)) == 0
