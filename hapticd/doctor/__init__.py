"""What keeps a computer from running a good loop and from reaching its device, and what mends it."""
