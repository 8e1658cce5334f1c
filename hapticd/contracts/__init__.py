"""What a device is, what a law is, what one tick records: the modules that plug-ins import."""
