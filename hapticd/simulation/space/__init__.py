"""The simulated device with two or three axes: each a device of its own, or all of them in one mass matrix."""
