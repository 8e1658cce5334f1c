"""Write all runs down anew."""

from __future__ import annotations

import sys

from tests.recorded.runs import RUNS

if __name__ == "__main__":
    for name in sys.argv[1:] or RUNS:
        RUNS[name]().write(name)
