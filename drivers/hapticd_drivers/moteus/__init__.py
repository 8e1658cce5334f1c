"""Driver `moteus`: motors behind moteus controllers of mjbots, over fdcanusb or SocketCAN."""
