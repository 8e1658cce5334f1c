"""The closed loop, many times: device, one wall, law and force limit over a grid of parameters, on all cores.

A `Point` is one loop, a `Batch` runs many of them. The loop itself is `run`, plain Python; a study runs it compiled, a
test interpreted, and both give the daemon's numbers to the last bit.
"""

from hapticd.simulation.batch.arrays import Arrays
from hapticd.simulation.batch.engine import Batch
from hapticd.simulation.batch.kernel import run
from hapticd.simulation.batch.point import Point
from hapticd.simulation.batch.result import BatchResult
from hapticd.simulation.batch.state import TRACE_COLUMNS

__all__ = ["TRACE_COLUMNS", "Arrays", "Batch", "BatchResult", "Point", "run"]
