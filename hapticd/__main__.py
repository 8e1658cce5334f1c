"""`python -m hapticd` is `hapticd`."""

from hapticd.cli import main

main()
