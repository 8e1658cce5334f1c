"""The control process: one thread, one tick a period, nothing in it that can wait but the device."""
