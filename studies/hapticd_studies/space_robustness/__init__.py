"""Many random devices, shapes and hands in space, with friction, under some laws: who is steady, and who is not."""
