"""The version of hapticd, in a module of its own so that asking for it opens no door."""

__version__ = "0.2.0"
