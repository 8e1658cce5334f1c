"""The vendor's library: where it is, whether it is new enough, and its functions with their own errors."""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hapticd.errors import DriverError, PluginError
from hapticd.trace import DriverTrace
from hapticd_drivers.forcedimension.failures import failure
from hapticd_drivers.forcedimension.prototypes import OPTIONAL, PROTOTYPES

NAME = "libdrd.so.3"
OLDEST = (3, 14)
ADVISED = (3, 16)

GET_SDK = (
    "# download the SDK from forcedimension.com and unpack it, then in its directory:",
    "sudo cp -a lib/release/lin-*/lib*.so* /usr/local/lib/ && sudo ldconfig",
)
"""What puts the SDK where it is found."""

ENVIRONMENT = ("FDSDK", "FORCEDIM_SDK")
_USUAL = (Path("/usr/local/lib"), Path("~/.local/lib"))


class Sdk:
    """The SDK's functions as attributes, by their C names; one that this SDK lacks is no attribute.

    Args:
        library: file or directory of the SDK; None looks in the environment and the usual places.
        trace: where each call is kept, if any.

    Attributes:
        path: what was loaded.
        version: (major, minor, release, revision); (0, 0, 0, 0) when it does not say.

    Raises:
        PluginError: it is not there, cannot be loaded, is too old or lacks a function.
    """

    def __init__(self, library: str | None = None, trace: DriverTrace | None = None) -> None:
        self.path, handle = _load(library)
        for name, (result, *arguments) in PROTOTYPES.items():
            function = _function(handle, name)
            if function is None:
                # Normally libdhd comes with libdrd; an SDK that keeps them apart has it beside it.
                with contextlib.suppress(OSError):
                    function = _function(ctypes.CDLL(str(Path(self.path).with_name("libdhd.so.3"))), name)
            if function is not None:
                function.restype = result
                function.argtypes = arguments
                setattr(self, name, function if trace is None else _traced(name, function, trace))
        self.version = self._version()
        if self.version != (0, 0, 0, 0) and self.version[:2] < OLDEST:
            raise PluginError(
                f"omega7: {self.path} is SDK {dotted(self.version)}; hapticd needs {dotted(OLDEST)} or newer, "
                f"better {dotted(ADVISED)}"
            )
        missing = sorted(name for name in PROTOTYPES if not self.has(name) and name not in OPTIONAL)
        if missing:
            raise PluginError(
                f"omega7: {self.path} lacks {', '.join(missing)}: is it libdrd of the Force Dimension SDK?"
            )

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"SDK {dotted(self.version)} has no {name}")

    def has(self, name: str) -> bool:
        """Whether this SDK has a function."""
        return name in self.__dict__

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function whose result is negative when it fails.

        Raises:
            DriverError: it failed.
            PluginError: this SDK does not have it.
        """
        if not self.has(name):
            raise PluginError(f"omega7: SDK {dotted(self.version)} has no {name}, which the configuration asks for")
        result: int = getattr(self, name)(*arguments)
        if result < 0:
            raise self.failure(name)
        return result

    def last_error(self) -> int:
        """Number of the error of the call that has just failed on this thread."""
        number: int = self.dhdErrorGetLast()
        return number

    def failure(self, name: str) -> DriverError:
        """The error to raise for a function that has just failed on this thread; the SDK keeps one a thread."""
        number = self.last_error()
        text = self.dhdErrorGetLastStr() if self.has("dhdErrorGetLastStr") else None
        return failure(name, number, (text or b"").decode(errors="replace").strip())

    @contextlib.contextmanager
    def expert(self) -> Iterator[None]:
        """Expert mode for as long as it is needed: the watchdog and the TimeGuard can be set in no other."""
        self.call("dhdEnableExpertMode")
        try:
            yield
        finally:
            self.dhdDisableExpertMode()

    def _version(self) -> tuple[int, int, int, int]:
        numbers = [ctypes.c_int(0) for _ in range(4)]
        if self.has("dhdGetSDKVersion"):
            self.dhdGetSDKVersion(*map(ctypes.byref, numbers))
        major, minor, release, revision = (number.value for number in numbers)
        return major, minor, release, revision


def candidates(library: str | None) -> list[Path]:
    """Files to try, best first; the loader's own search comes after them.

    Args:
        library: what the configuration names; then nothing else is tried.
    """
    if library is not None:
        named = Path(library).expanduser()
        return _within(named) if named.is_dir() else [named]
    places = [Path(os.environ[name]) for name in ENVIRONMENT if os.environ.get(name)]
    return [file for place in [*places, *_USUAL] for file in _within(place.expanduser())]


def dotted(version: tuple[int, ...]) -> str:
    """A version as it is written: 3.17.6."""
    return ".".join(map(str, version))


def _within(place: Path) -> list[Path]:
    """The libdrd files of a directory or of an SDK's root, newest first; 3.17.10 is newer than 3.17.9."""
    release = place / "lib" / "release" / f"lin-{platform.machine()}-gcc"
    found = []
    for directory in (place, release, place / "lib"):
        with contextlib.suppress(OSError):
            files = [file for file in directory.glob("libdrd.so*") if file.is_file()]
            found += sorted(
                files, key=lambda file: [int(digits) for digits in re.findall(r"\d+", file.name)], reverse=True
            )
    return found


def _load(library: str | None) -> tuple[str, ctypes.CDLL]:
    refused = []
    names = [str(file) for file in candidates(library)]
    if library is None:
        names.append(NAME)
    for name in names:
        try:
            return name, ctypes.CDLL(name)
        except OSError as error:
            refused.append(str(error))
    if library is not None and not names:
        refused.append(f"{library}: no libdrd.so in it")
    raise PluginError(
        f"omega7: the Force Dimension SDK cannot be loaded ({'; '.join(refused)}): install it and set FDSDK, or "
        "device.options.library, to where it is (docs/omega7.md)"
    )


def _traced(name: str, function: Any, trace: DriverTrace) -> Callable[..., Any]:
    """A function of the SDK whose calls are kept: arguments as they are afterwards, with what was written to them."""

    def call(*arguments: Any) -> Any:
        result = function(*arguments)
        trace.keep(name, *map(_value, arguments), "=", result)
        return result

    return call


def _value(argument: Any) -> Any:
    number = getattr(argument, "_obj", argument)  # what byref() refers to
    return list(number) if isinstance(number, ctypes.Array) else getattr(number, "value", number)


def _function(handle: ctypes.CDLL, name: str) -> Any:
    try:
        return getattr(handle, name)
    except AttributeError:
        return None
