"""The tick with objects in space: what a scene without them never runs."""
