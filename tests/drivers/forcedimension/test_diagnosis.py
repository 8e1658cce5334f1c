"""What the driver says of the SDK, whichever way it was found."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd_drivers.forcedimension import diagnosis
from hapticd_drivers.forcedimension.driver import ForceDimension
from tests.drivers.forcedimension.bench import Bench


@pytest.fixture(autouse=True)
def _anywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fake is below /tmp, where a service may not look; these tests are about other things."""
    monkeypatch.setattr(diagnosis, "_CLOSED_TO_SERVICE", ())


def library(bench: Bench) -> tuple[str, str]:
    """Mark and text of what is said of the library."""
    found = ForceDimension.diagnose(bench.driver().options)[0]
    return found.mark, found.text


def test_a_good_sdk_is_named_with_its_version_and_its_file(bench: Bench) -> None:
    assert library(bench) == ("ok", f"Force Dimension SDK 3.17.5.0, {bench.directory}/libdrd.so.3")


@pytest.mark.parametrize(("minor", "mark", "says"), [(15, "advice", "3.16 or newer"), (13, "problem", "needs 3.14")])
def test_an_old_sdk_is_judged_as_the_driver_judges_it(bench: Bench, minor: int, mark: str, says: str) -> None:
    bench.set(-1, minor=minor)
    found = library(bench)
    assert found[0] == mark
    assert says in found[1]


@pytest.mark.parametrize("name", ["FDSDK", "FORCEDIM_SDK"])
def test_an_sdk_that_only_a_shell_knows_of_is_not_the_services(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv(name, str(bench.directory))
    (found, _) = ForceDimension.diagnose()
    assert found.mark == "advice"
    assert found.mend == (f'# in the configuration, [device.options]: library = "{bench.directory}/libdrd.so.3"',)
    assert library(bench)[0] == "ok"  # the configuration names it already


def test_an_sdk_that_the_loader_finds_by_its_name_is_shown_by_its_file(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is loaded in this process, so the loader knows it by its name."""
    monkeypatch.setattr("hapticd_drivers.forcedimension.sdk.candidates", lambda _: [])
    found = ForceDimension.diagnose()[0]
    assert found.mark == "ok"
    assert Path(found.text.rpartition(", ")[2]).is_absolute()
    assert "libdrd.so" in found.text
