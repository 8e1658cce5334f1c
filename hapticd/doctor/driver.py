"""What the configured driver itself says of this computer: nobody knows better where it looks and what will do."""

from __future__ import annotations

from hapticd import lookup
from hapticd.contracts.driver import DriverOptions
from hapticd.doctor.finding import Finding, ok, unknown


def needs(driver: str, options: DriverOptions | None) -> list[Finding]:
    """What it has and lacks.

    Args:
        driver: name of the configured driver.
        options: its options; None: its defaults.
    """
    (looked,) = lookup.look({driver: options}, find=False)
    found = [Finding(one.mark, one.text, one.mend) for one in looked.diagnoses]
    if looked.problem:
        found.append(unknown(f"{driver}: {looked.problem}"))
    return found or [ok(f"{driver} needs nothing that is not there")]
