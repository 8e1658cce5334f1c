"""Who may reach the daemon from another computer: CURVE key pairs, the list of clients, the gate that asks for them."""
