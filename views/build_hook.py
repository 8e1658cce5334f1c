"""Say so when the wheel is going to lack the page's plots: that build needs npm, and the rest of hapticd does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PageHook(BuildHookInterface[Any]):
    """Looks whether `make web` has been run."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Warn before a distribution without uPlot; an editable one takes it from the checkout, whenever it comes."""
        plots = Path(self.root) / "views/hapticd_views/dashboard/page/vendor/uPlot.esm.js"
        if version != "editable" and not plots.exists():
            self.app.display_warning("hapticd dashboard will not run from this build: run `make web` first (npm)")
