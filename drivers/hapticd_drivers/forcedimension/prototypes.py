"""The functions of libdhd and libdrd that hapticd calls: result, then every argument.

C++ default arguments do not exist in the ABI, so each call passes all of them, the device's ID last. `char ID` is a
`c_byte`; hapticd only passes IDs from 0 on, so that its sign never matters. `double[3][3]` is a pointer to 9 numbers.
"""

from __future__ import annotations

import ctypes
from typing import Any

_INT = ctypes.c_int
_UINT = ctypes.c_uint
_UCHAR = ctypes.c_ubyte
_BOOL = ctypes.c_bool
_DOUBLE = ctypes.c_double
_TEXT = ctypes.c_char_p
_ID = ctypes.c_byte
_INTS = ctypes.POINTER(ctypes.c_int)
_UCHARS = ctypes.POINTER(ctypes.c_ubyte)
_USHORTS = ctypes.POINTER(ctypes.c_ushort)
_DOUBLES = ctypes.POINTER(ctypes.c_double)

PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "dhdErrorGetLast": (_INT,),
    "dhdErrorGetLastStr": (_TEXT,),
    "dhdGetDeviceCount": (_INT,),
    "dhdGetAvailableCount": (_INT,),
    "dhdGetSDKVersion": (None, _INTS, _INTS, _INTS, _INTS),
    "dhdGetSystemType": (_INT, _ID),
    "dhdGetSystemName": (_TEXT, _ID),
    "dhdGetSerialNumber": (_INT, _USHORTS, _ID),
    "dhdGetVersion": (_INT, _DOUBLES, _ID),
    "dhdIsLeftHanded": (_BOOL, _ID),
    "dhdHasWrist": (_BOOL, _ID),
    "dhdHasGripper": (_BOOL, _ID),
    "dhdGetStatus": (_INT, _INTS, _ID),
    "dhdGetPosition": (_INT, _DOUBLES, _DOUBLES, _DOUBLES, _ID),
    "dhdGetPositionAndOrientationFrame": (_INT, _DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES, _ID),
    "dhdGetLinearVelocity": (_INT, _DOUBLES, _DOUBLES, _DOUBLES, _ID),
    "dhdConfigLinearVelocity": (_INT, _INT, _INT, _ID),
    "dhdGetGripperGap": (_INT, _DOUBLES, _ID),
    "dhdGetButtonMask": (_UINT, _ID),
    "dhdEmulateButton": (_INT, _UCHAR, _ID),
    "dhdSetForceAndTorqueAndGripperForce": (_INT, *[_DOUBLE] * 7, _ID),
    "dhdSetMaxForce": (_INT, _DOUBLE, _ID),
    "dhdEnableForce": (_INT, _UCHAR, _ID),
    "dhdSetBrakes": (_INT, _INT, _ID),
    "dhdStop": (_INT, _ID),
    "dhdSetGravityCompensation": (_INT, _INT, _ID),
    "dhdSetEffectorMass": (_INT, _DOUBLE, _ID),
    "dhdSetDeviceAngleDeg": (_INT, _DOUBLE, _ID),
    "dhdEnableExpertMode": (_INT,),
    "dhdDisableExpertMode": (_INT,),
    "dhdSetWatchdog": (_INT, _UCHAR, _ID),
    "dhdGetWatchdog": (_INT, _UCHARS, _ID),
    "dhdSetTimeGuard": (_INT, _INT, _ID),
    "drdOpenID": (_INT, _ID),
    "drdClose": (_INT, _ID),
    "drdIsSupported": (_BOOL, _ID),
    "drdIsInitialized": (_BOOL, _ID),
    "drdAutoInit": (_INT, _ID),
    "drdStop": (_INT, _BOOL, _ID),
}

OPTIONAL = frozenset(
    {
        "dhdErrorGetLastStr",
        "dhdGetAvailableCount",
        "dhdGetSDKVersion",
        "dhdGetSystemName",
        "dhdGetVersion",
        "dhdHasWrist",
        "dhdHasGripper",
        "dhdConfigLinearVelocity",
        "dhdEmulateButton",
        "dhdSetEffectorMass",
        "dhdSetDeviceAngleDeg",
        "dhdSetWatchdog",
        "dhdGetWatchdog",
        "dhdSetTimeGuard",
        "drdIsSupported",
    }
)
"""What an SDK may lack: whoever calls one of these asks `Sdk.has` first, and does without or says so."""

SATURATED = 2
"""Result of a force call: the motors cannot give that much, so it was scaled down in its direction. It is a success."""

STATUS_WORDS = 32
"""Room for `dhdGetStatus`: it writes 17 today and takes no length."""

# Places in the status.
STATUS_FORCE = 5
STATUS_ERROR = 9
STATUS_FORCE_OFF_CAUSE = 14
