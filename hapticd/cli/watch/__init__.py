"""`hapticd watch`: a live view of what a daemon measures."""
