"""One law against what was asked of the default law, and what its settings trade for each other."""
