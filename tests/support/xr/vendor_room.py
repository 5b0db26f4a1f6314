"""`launch.py vr` on a runtime with the vendor's passthrough, which Monado does not have.

vendor_room.py vr ...    arguments as of launch.py; beside the lines, a JSON file has what was asked
of the vendor's functions, and of each frame the kinds of its layers and its blend mode.
"""

import ctypes
import json
import os
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
NAME = "XR_FB_passthrough"


class VendorRoom:
    """Answers in the place of a runtime; the calls go through xrGetInstanceProcAddr, as there."""

    def __init__(self, xr: Any, refuses: str = "") -> None:
        self.xr, self.refuses = xr, refuses  # name of a function that fails
        self.calls: list[str] = []
        self.frames: list[dict] = []
        self.kept: list[Any] = []  # of ctypes, as long as it is called
        self.events: list[int] = []  # flags of state changes to come

    def address(self, name: str) -> int:
        """Of a function of the vendor's that notes that it was called."""
        xr = self.xr
        kind = getattr(xr, f"PFN_{name}")
        unsupported = int(xr.Result.ERROR_FEATURE_UNSUPPORTED)

        def answer(*given: Any) -> int:
            self.calls.append(name)
            if name.startswith("xrCreate") and name != self.refuses:
                ctypes.cast(given[2], ctypes.POINTER(ctypes.c_uint64))[0] = 40 + len(self.calls)
            return unsupported if name == self.refuses else 0

        made = kind(answer)
        self.kept.append(made)
        return ctypes.cast(made, ctypes.c_void_p).value or 0

    def switch_on(self) -> None:
        """Puts itself between the program and the runtime."""
        xr = self.xr
        listed, created = xr.enumerate_instance_extension_properties, xr.create_instance
        found, end_frame, poll = xr.get_instance_proc_addr, xr.end_frame, xr.poll_event

        def extensions(*given):
            return [*listed(*given), xr.ExtensionProperties(extension_name=NAME)]

        def create(info, *given):
            names = [
                name.decode() if isinstance(name, bytes) else str(name)
                for name in info.enabled_extension_names
            ]
            self.calls += [f"asked for {name}" for name in names if name == NAME]
            rest = [name for name in names if name != NAME]
            plain = xr.InstanceCreateInfo(
                application_info=info.application_info, enabled_extension_names=rest
            )
            return created(plain, *given)

        def address(instance, name):
            if "assthrough" not in str(name):
                return found(instance, name)
            return ctypes.cast(self.address(str(name)), xr.PFN_xrVoidFunction)

        def end(session, info):
            kinds = [int(layer.contents.type) for layer in info.layers]
            self.frames.append({"kinds": kinds, "blend": int(info.environment_blend_mode)})
            vendors = int(xr.StructureType.COMPOSITION_LAYER_PASSTHROUGH_FB)
            own = [info.layers[i] for i, kind in enumerate(kinds) if kind != vendors]
            rest = xr.FrameEndInfo(info.display_time, info.environment_blend_mode, layers=own)
            return end_frame(session, rest)

        def event(instance):
            if self.events and len(self.frames) > 3:
                changed = xr.EventDataPassthroughStateChangedFB(
                    flags=xr.PassthroughStateChangedFlagsFB(self.events.pop(0))
                )
                buffer = xr.EventDataBuffer()
                ctypes.memmove(ctypes.byref(buffer), ctypes.byref(changed), ctypes.sizeof(changed))
                return buffer
            return poll(instance)

        xr.enumerate_instance_extension_properties, xr.create_instance = extensions, create
        xr.end_frame, xr.poll_event = end, event
        xr.get_instance_proc_addr = xr.functions.get_instance_proc_addr = address


def main(arguments: list[str]) -> int:
    sys.path.insert(0, str(ROOT))
    import xr

    import shapeshift  # noqa: F401  makes the folders its subpackages
    from shapeshift.app.cli import main as run

    room = VendorRoom(xr, os.environ.get("SHAPESHIFT_TEST_REFUSES", ""))
    room.events = json.loads(os.environ.get("SHAPESHIFT_TEST_EVENTS", "[]"))
    room.switch_on()
    try:
        return run(arguments)
    finally:
        told = {"calls": room.calls, "frames": room.frames}
        Path(os.environ["SHAPESHIFT_TEST_ROOM"]).write_text(json.dumps(told))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
