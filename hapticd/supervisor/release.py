"""Take the force away after a control process that died or hangs: `python -m hapticd.supervisor.release`.

A short-lived process of its own, so that a driver that hangs cannot hang the supervisor. It reads the configuration's
text from its standard input.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys

from hapticd.config.loading import LoadedConfig, parse
from hapticd.contracts.errors import HapticdError

TIMEOUT_S = 2.0
"""How long the device may take to let go [s]."""


def release_device(config: LoadedConfig) -> str:
    """Open the device in a helper process and disable it.

    Returns:
        What came of it, a line for people.
    """
    try:
        helper = subprocess.run(
            [sys.executable, "-m", "hapticd.supervisor.release"],
            input=config.text.encode(),
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"the device did not answer within {TIMEOUT_S:g} s; its own watchdog has to release it"
    if helper.returncode:
        return f"the device could not be opened: {helper.stderr.decode(errors='replace').strip()}"
    return "the device is without force"


def main() -> int:
    """Open, disable, close."""
    try:
        config = parse(sys.stdin.read(), "standard input")
        driver = config.driver(config.options, config.config.loop.period_s)
        driver.open()
        driver.close()
    except HapticdError as error:
        with contextlib.suppress(OSError):
            sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
