"""hapticd: a service that owns a kinesthetic haptic device and publishes what it does, tick by tick."""

__version__ = "0.2.0"
