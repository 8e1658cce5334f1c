"""The control process: one thread ticks, once a period, and nothing in it can wait but the device."""
