"""Write all runs down anew, and drop what no run gives any more: after every change of a law that is meant.

python -m tests.recorded
"""

from __future__ import annotations

import sys

from tests.recorded.journal import forget_others
from tests.recorded.runs import RUNS

if __name__ == "__main__":
    for name in sys.argv[1:] or RUNS:
        RUNS[name]().write(name)
    forget_others(RUNS)
