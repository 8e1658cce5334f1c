"""Who may reach the daemon from another computer: CURVE key pairs, the list of clients, the guarded endpoint."""
