"""Force Dimension's devices (omega.x, delta.x, sigma.x, lambda.x) through the vendor's own library, libdrd and libdhd.

Nothing here needs the library to be imported: it is looked for when a device is opened.
"""
