"""The process that hears the clients of a scene and streams them the device's state, beside loop and supervisor."""
