"""What drivers find, and what they say of this computer; each is asked in a process of its own.

A driver looks through somebody else's library, which may hang or crash; it then spoils no other driver's answer. The
process is `python -m hapticd.discovery`: a request on its standard input, the answer on its standard output, as JSON.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from hapticd import plugins
from hapticd.device import Diagnosis, FoundDevice
from hapticd.driver import Driver, DriverOptions
from hapticd.errors import HapticdError

T = TypeVar("T")

TIMEOUT_S = 30.0
"""How long a driver may look [s]."""


@dataclass(frozen=True, slots=True)
class Discovery:
    """What a driver has answered.

    Attributes:
        driver: its name.
        devices: what it found.
        diagnoses: what it says of this computer.
        absent: what to do when it found nothing.
        problem: why the answer is not whole; "" when it is.
        looks: whether it can look for devices; one without a `find` of its own may drive what is there all the same.
    """

    driver: str
    devices: tuple[FoundDevice, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    absent: str = ""
    problem: str = ""
    looks: bool = True


def look(
    drivers: Mapping[str, DriverOptions | None], *, find: bool = True, timeout_s: float = TIMEOUT_S
) -> list[Discovery]:
    """Ask drivers, all at once.

    Args:
        drivers: their names, each with its options; None: its defaults.
        find: look for devices as well, which may open each of them for a moment.
        timeout_s: how long each of them may take [s].
    """
    with ThreadPoolExecutor(max_workers=max(1, len(drivers))) as pool:
        return list(pool.map(lambda name: _ask(name, drivers[name], find, timeout_s), drivers))


def _ask(name: str, options: DriverOptions | None, find: bool, timeout_s: float) -> Discovery:
    given = None if options is None else options.model_dump(mode="json", exclude_unset=True)
    request = json.dumps({"driver": name, "options": given, "find": find})
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "hapticd.discovery"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace",
    )  # fmt: skip
    try:
        answer, words = process.communicate(request, timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(1.0)  # one that waits for its hardware inside the kernel cannot even be killed
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()
        return Discovery(name, problem=f"it did not answer within {timeout_s:g} s")
    if process.returncode != 0 or not answer:
        died = process.returncode < 0
        how = f"it crashed, signal {-process.returncode}" if died else f"it ended with exit code {process.returncode}"
        last = words.strip().rpartition("\n")[2]
        return Discovery(name, problem=f"{how}: {last}" if last else how)
    said = json.loads(answer)
    return Discovery(
        name,
        tuple(FoundDevice(**{**device, "mend": tuple(device["mend"])}) for device in said["devices"]),
        tuple(Diagnosis(**{**one, "mend": tuple(one["mend"])}) for one in said["diagnoses"]),
        said["absent"],
        said["problem"],
        said["looks"],
    )


def _answer(request: Mapping[str, Any]) -> Discovery:
    """Ask the driver, in the process that is there for it."""
    name = request["driver"]
    try:
        driver = plugins.driver(name)
        given = request["options"]
        options = None if given is None else driver.Options.model_validate(given)
    except Exception as error:  # noqa: BLE001 - a plug-in is anybody's code
        return Discovery(name, problem=_told(error))
    devices: list[FoundDevice] = []
    diagnoses: list[Diagnosis] = []
    problems = []
    try:
        diagnoses = [_of(Diagnosis, one) for one in driver.diagnose(options)]
    except Exception as error:  # noqa: BLE001 - a plug-in is anybody's code
        problems.append(_told(error))
    try:
        devices = [_of(FoundDevice, one) for one in driver.find(options)] if request["find"] else []
    except Exception as error:  # noqa: BLE001 - a plug-in is anybody's code
        problems.append(_told(error))
    looks = inspect.getattr_static(driver, "find") is not vars(Driver)["find"]
    return Discovery(name, tuple(devices), tuple(diagnoses), driver.ABSENT, "; ".join(problems), looks)


def _of(kind: type[T], one: object) -> T:
    if not isinstance(one, kind):
        raise TypeError(f"{one!r} is no {kind.__name__}")
    return one


def _told(error: Exception) -> str:
    return str(error) if isinstance(error, HapticdError) else f"its driver failed: {type(error).__name__}: {error}"


def main() -> None:
    """Answer one request; what a library prints goes elsewhere."""
    with os.fdopen(os.dup(1), "w") as answer:
        os.dup2(2, 1)
        json.dump(asdict(_answer(json.load(sys.stdin))), answer)
    os._exit(0)  # the answer is out, and a library's threads or its own end could still spoil it


if __name__ == "__main__":
    main()
