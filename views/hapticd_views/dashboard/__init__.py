"""The page of a running daemon in the browser: a process of its own, and a plain client of the daemon."""
