"""Find drivers and laws by name: installed entry points, or for a law any importable module; imported when asked."""

from __future__ import annotations

import importlib
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any

from hapticd.driver import Driver
from hapticd.errors import PluginError
from hapticd.law import check_law

DRIVERS = "hapticd.drivers"
CONTROLLERS = "hapticd.controllers"


def names(group: str) -> list[str]:
    """Names installed in an entry-point group, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def driver(name: str) -> type[Driver[Any]]:
    """The driver class installed under a name.

    Raises:
        PluginError: there is none, it cannot be imported, or it is not a `Driver`.
    """
    point = _find(DRIVERS, name)
    if point is None:
        raise PluginError(f"no driver {name!r}: installed are {', '.join(names(DRIVERS)) or 'none'}")
    loaded = _load(point)
    if not (isinstance(loaded, type) and issubclass(loaded, Driver)):
        raise PluginError(f"driver {name}: {point.value} is not a hapticd.driver.Driver")
    return loaded


def law(name: str) -> ModuleType:
    """The law module installed under a name, or the importable module of that dotted name.

    Raises:
        PluginError: there is none, it cannot be imported, or it does not keep the contract of a law.
    """
    point = _find(CONTROLLERS, name)
    if point is not None:
        loaded = _load(point)
    elif "." in name:
        try:
            loaded = importlib.import_module(name)
        except (Exception, SystemExit) as error:
            raise PluginError(f"law module {name!r} cannot be imported: {type(error).__name__}: {error}") from error
    else:
        raise PluginError(
            f"no law {name!r}: installed are {', '.join(names(CONTROLLERS)) or 'none'}; a module of your own is named "
            "with a dot, `package.module`"
        )
    if not isinstance(loaded, ModuleType):
        raise PluginError(f"law {name}: {loaded!r} is not a module")
    check_law(loaded)
    return loaded


def _find(group: str, name: str) -> EntryPoint | None:
    return next(iter(entry_points(group=group, name=name)), None)


def _load(point: EntryPoint) -> Any:
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        raise PluginError(
            f"{point.name} ({point.value}) cannot be imported: {type(error).__name__}: {error}"
        ) from error
