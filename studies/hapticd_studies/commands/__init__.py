"""The commands `hapticd study ...`, thin modules over the studies."""
