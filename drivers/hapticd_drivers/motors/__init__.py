"""Motor controllers on a CAN bus, each of which turns a drum whose cord pulls the handle along one axis."""
