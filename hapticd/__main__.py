"""`python -m hapticd` is `hapticd`."""

import sys

if not sys.flags.safe_path:  # -m puts the working directory first, and what lies there is none of the program's
    del sys.path[0]

from hapticd.cli import main

main()
