"""How often the headset's display shows a picture, where the runtime tells it."""

import ctypes
from typing import Any

from shapeshift.vr.openxr.instance import DISPLAY_RATE, Instance


def display_period(instance: Instance, session: Any) -> float:
    """Seconds between two pictures of the display; 0 where the runtime does not tell."""
    if DISPLAY_RATE not in instance.extensions:
        return 0.0
    xr = instance.xr
    address = xr.get_instance_proc_addr(instance.handle, "xrGetDisplayRefreshRateFB")
    ask = ctypes.CFUNCTYPE(ctypes.c_int, xr.Session, ctypes.POINTER(ctypes.c_float))(
        ctypes.cast(address, ctypes.c_void_p).value or 0
    )
    hz = ctypes.c_float(0.0)
    if ask(session, ctypes.byref(hz)) != 0:  # XR_SUCCESS
        return 0.0
    return 1 / hz.value if hz.value > 0 else 0.0
