"""Work over many cells, on all cores or on a cluster, that an interruption costs nothing but time."""
