"""A figure as a file: PNG, SVG or PDF, the same bytes for the same figure."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from hapticd.errors import ConfigError
from hapticd.replacing import write

SUFFIXES = (".png", ".svg", ".pdf")
"""What a file of a figure may end in."""

_NO_DATE = {".png": {"Software": None}, ".svg": {"Date": None, "Creator": None}, ".pdf": {"CreationDate": None}}


def encoded(figure: Figure, suffix: str, dots_per_inch: float | None = None) -> bytes:
    """A figure as the content of a file.

    Args:
        figure: drawn.
        suffix: one of `SUFFIXES`.
        dots_per_inch: of what is no vector; None: as its style has it.
    """
    content = io.BytesIO()
    dpi = dots_per_inch or mpl.rcParams["savefig.dpi"]
    with mpl.rc_context({"svg.hashsalt": "hapticd"}):
        figure.savefig(content, format=suffix[1:], metadata=_NO_DATE[suffix], dpi=dpi)
    return content.getvalue()


def save(figure: Figure, path: Path) -> None:
    """Write a figure to a file.

    Raises:
        ConfigError: no format is known by its suffix.
        HapticdError: it cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise ConfigError(f"{path}: must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    write(path, encoded(figure, path.suffix))


def inline_image(figure: Figure, name: str) -> str:
    """A figure as an HTML image that carries its own data, at the size of a screen.

    Args:
        figure: drawn.
        name: for those who do not see it; no markup.
    """
    content = base64.b64encode(encoded(figure, ".png", 160)).decode("ascii")
    return f'<img alt="{name}" src="data:image/png;base64,{content}">'
