"""Built-in drivers, one module a device."""
