"""Built-in laws, one module a law."""
