"""Find drivers and laws by name: installed entry points, or any importable module; imported when asked."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import signal
import sys
import threading
import zlib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import FrameType, FunctionType, ModuleType
from typing import Any, NoReturn

from hapticd.driver import Driver
from hapticd.errors import PluginError, alike, in_words
from hapticd.law import check_law

DRIVERS = "hapticd.drivers"
CONTROLLERS = "hapticd.controllers"

_found: dict[tuple[str, str], EntryPoint] = {}
"""Points by group and name, kept: a look through all that is installed takes 10 ms, and what is imported stays so."""


def names(group: str) -> list[str]:
    """Names installed in an entry-point group, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def is_installed(group: str, name: str) -> bool:
    """Whether an entry-point group has a name, without the look through all of them that `names` takes."""
    return _find(group, name) is not None


def driver(name: str) -> type[Driver[Any]]:
    """The driver class installed under a name, or one of an importable module.

    Args:
        name: an installed name; `package.module.Class`; or `package.module`, which holds one driver or says
            `DRIVER = Class`.

    Raises:
        PluginError: there is none, it cannot be imported, or it is not a whole `Driver`.
    """
    point = _find(DRIVERS, name)
    if point is not None:
        return _checked_driver(name, point.value, _load(point))
    if "." in name:
        return _driver_of_module(name)
    raise PluginError(_unknown(DRIVERS, "driver", name, "one of your own"))


def law(name: str) -> ModuleType:
    """The law module installed under a name, or the importable module of that dotted name.

    Raises:
        PluginError: there is none, it cannot be imported, or it does not keep the contract of a law.
    """
    point = _find(CONTROLLERS, name)
    if point is not None:
        loaded = _load(point)
    elif "." in name:
        loaded = _imported("law", name, name)
    else:
        raise PluginError(_unknown(CONTROLLERS, "law", name, "a module of your own"))
    if not isinstance(loaded, ModuleType):
        raise PluginError(f"law {name}: {loaded!r} is not a module")
    check_law(loaded)
    code_of(loaded)
    return loaded


@cache
def code_of(law: ModuleType) -> int:
    """A number that another code of a law differs in; it is of what is imported, not of what was edited since.

    It is taken when this is called first, as `law` does at the import: of the law's file, and of those of its package
    from which it has modules, classes or functions.
    """
    package = law.__name__.partition(".")[0]
    found, waiting = {law.__name__: law}, [law]
    while waiting:
        for each in tuple(vars(waiting.pop()).values()):
            name = ""
            if isinstance(each, ModuleType):
                name = each.__name__
            elif isinstance(each, type | FunctionType):  # of anything else nobody knows what a look at it does
                name = str(each.__module__)
            module = sys.modules.get(name)
            if name.partition(".")[0] == package and name not in found and isinstance(module, ModuleType):
                found[name] = module
                waiting.append(module)
    code = 0
    for name in sorted(found):
        with contextlib.suppress(OSError, ValueError):  # a package needs no file
            code = zlib.crc32(Path(getattr(found[name], "__file__", None) or "").read_bytes(), code)
    return code


def _unknown(group: str, kind: str, name: str, own: str) -> str:
    """What to say of a name that is not installed."""
    installed = names(group)
    listed = f"installed are {', '.join(installed) or 'none'}; {own} is named with a dot, `package.module`"
    return f"no {kind} {name!r}: " + " ".join(filter(None, (alike(name, installed), listed)))


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, and not what a plug-in raises by itself."""


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Have Ctrl-C told apart, where it would be a KeyboardInterrupt: in the main thread, with no handler of another."""
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is _interrupt:  # the plug-in may have set one of its own
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _driver_of_module(name: str) -> type[Driver[Any]]:
    """The driver of `package.module` or `package.module.Class`."""
    try:
        module = _imported("driver", name, name)
    except PluginError as error:
        if not (isinstance(error.__cause__, ModuleNotFoundError) and error.__cause__.name == name):
            raise
        owner, _, last = name.rpartition(".")
        module = _imported("driver", name, owner)
        if hasattr(module, last):
            return _checked_driver(name, name, getattr(module, last))
        raise PluginError(
            f"driver {name!r}: there is no module {name}, and {owner} has no class {last}; {_held(module)}"
        ) from None
    if hasattr(module, "DRIVER"):
        return _checked_driver(name, f"{name}.DRIVER", module.DRIVER)
    found = _drivers_in(module)
    if len(found) != 1:
        raise PluginError(
            f"driver {name!r}: {_held(module)}; name the class, `{name}.Class`, or say `DRIVER = Class` in the module"
        )
    return _checked_driver(name, f"{name}.{found[0].__name__}", found[0])


def _drivers_in(module: ModuleType) -> list[type[Driver[Any]]]:
    """The drivers that a module defines, without those that it imports."""
    return [
        each
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, Driver) and each.__module__ == module.__name__
    ]


def _held(module: ModuleType) -> str:
    """What drivers a module defines, in words."""
    defined = ", ".join(each.__name__ for each in _drivers_in(module))
    return f"{module.__name__} defines {defined or 'no subclass of hapticd.driver.Driver'}"


def _checked_driver(name: str, place: str, loaded: object) -> type[Driver[Any]]:
    """What was found under a name, if it is a driver with every hook.

    Raises:
        PluginError: it is not.
    """
    if not (isinstance(loaded, type) and issubclass(loaded, Driver)):
        raise PluginError(f"driver {name}: {place} is not a hapticd.driver.Driver")
    if inspect.isabstract(loaded):
        lacking = ", ".join(sorted(loaded.__abstractmethods__))
        raise PluginError(f"driver {name}: {place} lacks {lacking}: see docs/drivers.md")
    return loaded


def _imported(kind: str, name: str, module: str) -> ModuleType:
    """A module, for a plug-in that is named by it.

    Raises:
        PluginError: it cannot be imported; caused by what went wrong.
    """
    try:
        with interruptible():
            return importlib.import_module(module)
    except Interrupted:
        raise
    except BaseException as error:
        raise PluginError(f"{kind} module {name!r} cannot be imported: {in_words(error, module)}") from error


def _find(group: str, name: str) -> EntryPoint | None:
    """What is installed under a name; a name that was not found is looked for again, since it may be installed now."""
    point = _found.get((group, name)) or next(iter(entry_points(group=group, name=name)), None)
    if point is not None:
        _found[group, name] = point
    return point


def _load(point: EntryPoint) -> Any:
    try:
        with interruptible():
            return point.load()
    except Interrupted:
        raise
    except BaseException as error:
        said = in_words(error, point.module)
        raise PluginError(f"{point.name} ({point.value}) cannot be imported: {said}") from error


def _interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
    raise Interrupted
