"""Dialects of other device services, spoken outwards for programs that exist; inwards only what any client speaks."""
