"""`hapticd metrics`: what the daemons say of themselves, for Prometheus."""
