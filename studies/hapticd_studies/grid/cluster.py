"""Blocks of a study on the workers of an existing dask scheduler; a worker that dies costs time and no result."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any

import distributed

from hapticd.errors import ConfigError, HapticdError
from hapticd_studies.grid.job import Job, Work, code_digest
from hapticd_studies.grid.journal import Row

_ANSWERS_WITHIN_S = 15
_dask: Any = distributed  # its types are incomplete
_ONE_AT_A_TIME = threading.Lock()


def blocks(address: str, job: Job, wanted: Sequence[int]) -> Iterator[tuple[int, list[Row]]]:
    """Do blocks on a cluster; they come as they are finished.

    dask does again elsewhere whatever was lost with a worker.

    Args:
        address: of the scheduler, `tcp://host:8786`.
        job: the study.
        wanted: numbers of the blocks.

    Raises:
        ConfigError: no such address, or no worker there.
        HapticdError: the scheduler is gone, or the workers cannot do it.
    """
    _hush()
    try:
        client = _dask.Client(address, timeout=_ANSWERS_WITHIN_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigError(f"--cluster {address}: no dask scheduler answers there ({_first_line(error)})") from None
    with closing(client):
        try:
            client.wait_for_workers(1, timeout=_ANSWERS_WITHIN_S)
        except TimeoutError:
            raise ConfigError(
                f"--cluster {address}: the scheduler has no workers; start some: dask worker {address}"
            ) from None
        digest = code_digest(job.laws)
        futures = {
            client.submit(_block, job.work, job.spec, block, job.laws, digest, pure=False): block for block in wanted
        }
        try:
            for future in _dask.as_completed(list(futures), loop=client.loop):
                block = futures.pop(future)  # and with it the worker's copy of the rows
                yield block, future.result()
        except HapticdError:
            raise
        except distributed.KilledWorker as error:
            raise HapticdError(f"--cluster {address}: gave up on a block that killed its workers: {error}") from None
        except (OSError, distributed.CancelledError) as error:
            raise HapticdError(
                f"--cluster {address}: lost the scheduler ({_first_line(error)}); finished cells are kept, the same "
                "command goes on from there"
            ) from None
        except ImportError as error:
            raise HapticdError(
                f"--cluster {address}: a worker lacks a module: {error}; install the same hapticd[study] on all of them"
            ) from None


def _block(work: Work, spec: object, block: int, laws: tuple[str, ...], digest: str) -> list[Row]:
    """One block on a worker; the engine has threads of its own, so only one block at a time in a process."""
    worker = _dask.get_worker()
    if code_digest(laws) != digest:
        raise HapticdError(
            f"worker {worker.address} has another hapticd or another law of that name: install the same everywhere"
        )
    with _ONE_AT_A_TIME:
        return work(spec, block, worker.state.nthreads)


def _hush() -> None:
    """Keep dask's own log from the terminal: what matters is said here, in one line."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _first_line(error: BaseException) -> str:
    return str(error).partition("\n")[0] or type(error).__name__
