"""What the author of a driver or a law proves it with: two pytest suites, and a press of a simulated hand.

    class TestMyRig(hapticd.testing.DriverContract): ...          a fixture and a method name driver and device
    class TestMyLaw(hapticd.testing.LawContract): law = "mylab.my_law"
    hapticd.testing.press("mylab.my_law", stiffness_n_per_m=12e3).settled

The suites need pytest; `press` does not. The built-in drivers and laws pass the same suites.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hapticd.testing.driver_contract import DriverContract
    from hapticd.testing.law_contract import LawContract
    from hapticd.testing.law_press import press

__all__ = ["DriverContract", "LawContract", "press"]

_MODULES = {
    "DriverContract": "hapticd.testing.driver_contract",
    "LawContract": "hapticd.testing.law_contract",
    "press": "hapticd.testing.law_press",
}

_pytest = sys.modules.get("pytest")
if _pytest is not None:  # then a failed assertion of a suite shows its values, as in a test of one's own
    _pytest.register_assert_rewrite(*sorted(set(_MODULES.values())))


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(importlib.import_module(_MODULES[name]), name)
    except ModuleNotFoundError as error:
        if error.name != "pytest":
            raise
        raise ModuleNotFoundError(f"hapticd.testing.{name} needs pytest: pip install pytest", name="pytest") from None
