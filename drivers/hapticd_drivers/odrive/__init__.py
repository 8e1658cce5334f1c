"""Driver `odrive`: motors behind ODrive controllers (Pro, S1, Micro), over CAN by the CANSimple protocol."""
