"""The device rules: who may open a device is udev's decision."""

from __future__ import annotations

from pathlib import Path

from hapticd.doctor.finding import Finding, advice, ok, own_command
from hapticd.doctor.tree import ROOT, read
from hapticd.paths import directory

_PLACES = ("etc/udev/rules.d", "usr/local/lib/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")


def installed(driver: str, root: Path = ROOT) -> list[Finding]:
    """Whether udev knows the rules that are shipped.

    Args:
        driver: name of the configured driver.
        root: the file system.
    """
    return [_state(rule, driver, root) for rule in sorted(directory("drivers/udev").glob("*.rules"))]


def _state(rule: Path, driver: str, root: Path) -> Finding:
    install = f"sudo {own_command('service', 'install')}"
    for place in _PLACES:
        there = root / place / rule.name
        if there.exists():
            if read(there) == rule.read_text().strip():
                return ok(f"/{place}/{rule.name}")
            return advice(f"/{place}/{rule.name} is not the one of this hapticd", install)
    if driver == "loopback":
        return ok(f"{rule.name} is not installed; loopback needs no device")
    return advice(f"{rule.name} is not installed: only root may open a device", install)
