"""`hapticd bench`: what parts of the service cost on this machine, next to a reference measured in the same run."""
