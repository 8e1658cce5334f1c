"""The vendor's SDK, which the omega7 driver loads: found by the names of files alone, nothing is loaded."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from hapticd.doctor.finding import Finding, advice, ok, problem
from hapticd.doctor.tree import ROOT, listed, under

_DRIVER = "omega7"
_NAME = re.compile(r"lib(?:drd|dhd)\.so((?:\.\d+)*)")
_ROOTS = ("FDSDK", "FORCEDIM_SDK")
_SYSTEM = ("/usr/local/lib", "/usr/lib/x86_64-linux-gnu", "/usr/lib", "/usr/lib64", "/lib")
_REQUIRED = (3, 14)
_RECOMMENDED = (3, 16)
_CLOSED_TO_SERVICE = ("/home", "/root", "/tmp")


def vendor(driver: str, environment: Mapping[str, str], home: Path, root: Path = ROOT) -> Finding:
    """Whether the Force Dimension SDK is where the driver finds it.

    Args:
        driver: name of the configured driver.
        environment: names the SDK's directory, or not.
        home: of the user.
        root: the file system.
    """
    for place in _places(environment, home, root):
        versions = {file: _version(file) for file in listed(place) if _NAME.fullmatch(file.name)}
        if versions:
            shown = f"/{place.relative_to(root)}"
            return _judged(driver, shown, max(versions.values()))
    if driver != _DRIVER:
        return ok("no Force Dimension SDK; not needed for the configured driver")
    return problem(
        "no Force Dimension SDK (libdrd.so.3): omega7 cannot reach its device",
        "# download it from forcedimension.com and unpack it, then in its directory:",
        "sudo cp -a lib/release/lin-*/lib*.so* /usr/local/lib/ && sudo ldconfig",
    )


def _judged(driver: str, place: str, version: tuple[int, ...]) -> Finding:
    number = ".".join(map(str, version))
    what = f"Force Dimension SDK {number} in {place}" if len(version) > 1 else f"Force Dimension SDK in {place}"
    if driver != _DRIVER:
        return ok(f"{what}; not needed for the configured driver")
    newer = (
        "# download a newer one from forcedimension.com and unpack it, then in its directory:",
        "sudo cp -a lib/release/lin-*/lib*.so* /usr/local/lib/ && sudo ldconfig",
    )
    if len(version) > 1 and version < _REQUIRED:
        return problem(f"{what}: too old, 3.14 is the oldest that will do", *newer)
    if len(version) > 1 and version < _RECOMMENDED:
        return advice(f"{what}: old, 3.16 or newer is better", *newer)
    if place.startswith(_CLOSED_TO_SERVICE):
        return advice(
            f"{what}, where the system service may not look",
            f"sudo cp -a {place}/lib*.so* /usr/local/lib/ && sudo ldconfig",
        )
    return ok(what)


def _places(environment: Mapping[str, str], home: Path, root: Path) -> Iterator[Path]:
    for name in _ROOTS:
        if environment.get(name):
            sdk = under(root, environment[name])
            yield from sorted(sdk.glob("lib/release/lin-*"))
            yield from (sdk / "lib", sdk)
    for part in filter(None, environment.get("LD_LIBRARY_PATH", "").split(":")):
        yield under(root, part)
    yield under(root, home / ".local/lib")
    for place in _SYSTEM:
        yield under(root, place)


def _version(file: Path) -> tuple[int, ...]:
    """The longest number in the name of a library or of what it links to."""
    found = [_NAME.fullmatch(name) for name in (file.name, file.resolve().name)]
    numbers = [tuple(int(part) for part in match[1].split(".") if part) for match in found if match]
    return max(numbers, key=len)
