"""The commands `hapticd bench ...`, thin modules over the measurements."""
