"""A whole life of the driver on the fake, in a process of its own: for a sanitiser, or another build of the fake.

python -m tests.drivers.forcedimension.exercise DIRECTORY [short-status]
"""

from __future__ import annotations

import ctypes
import functools
import sys
from pathlib import Path

from hapticd_drivers.forcedimension.driver import ForceDimension
from hapticd_drivers.forcedimension.models import MODELS
from tests.drivers.forcedimension.bench import BRAKE, RESET, Bench


def main(directory: Path, short_status: bool) -> None:
    bench = Bench(directory)
    for device_type, model in MODELS.items():
        bench.set(type=device_type, calibrated=0)
        driver = bench.driver(status_every_ticks=2)
        driver.open()
        if short_status:  # what a binding with too little room would do
            driver._status = (ctypes.c_int * 16)()
            driver._get_status = functools.partial(driver._opened().dhdGetStatus, driver._status, 0)
        if model.to_calibrate:
            driver.calibrate()
        driver.enable()
        for tick in range(600):
            driver.read()
            driver.write([0.01 * tick, -1.0, 0.5])
        bench.press_force_button()
        driver.disable()
        driver.close()
        assert bench.get("mode") == (BRAKE if model.to_calibrate else RESET)
    assert len(ForceDimension.find(driver.options)) == 1
    print("done")  # noqa: T201 - what the test that started this looks for


if __name__ == "__main__":
    main(Path(sys.argv[1]), "short-status" in sys.argv)
