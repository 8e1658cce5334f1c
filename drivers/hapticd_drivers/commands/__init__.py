"""Commands for devices of one's own, thin modules over what measures them."""
