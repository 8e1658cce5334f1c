"""What the computer is asked to keep: the installed service, its user, its units."""
