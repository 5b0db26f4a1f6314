"""The door to OpenXR: which runtime is active, which headset it has, or one sentence why none."""

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.plain_text import LONGEST_NAME, one_line
from shapeshift.runtime_models.program import package_words

NAME = "Shapeshift"
API = (1, 0, 34)  # every runtime still in use speaks it
API_OF_INSETS = (1, 1, 0)  # from it on four views a frame need no extension
DRAWING = ("XR_KHR_opengl_enable", "XR_MNDX_egl_enable")  # one of them is needed
LOCAL_FLOOR, DISPLAY_RATE = "XR_EXT_local_floor", "XR_FB_display_refresh_rate"
DEPTH_LAYER, HAND_TRACKING = "XR_KHR_composition_layer_depth", "XR_EXT_hand_tracking"
VISIBILITY_MASK, PASSTHROUGH = "XR_KHR_visibility_mask", "XR_FB_passthrough"
EYE_GAZE, QUAD_VIEWS = "XR_EXT_eye_gaze_interaction", "XR_VARJO_quad_views"
WANTED = (
    LOCAL_FLOOR,
    DISPLAY_RATE,
    DEPTH_LAYER,
    HAND_TRACKING,
    VISIBILITY_MASK,
    PASSTHROUGH,
    EYE_GAZE,
    QUAD_VIEWS,
)  # good to have
HOW_TO = (
    "start SteamVR, WiVRn or Monado and make it the active OpenXR runtime, or name its manifest in "
    "XR_RUNTIME_JSON (a Quest comes to SteamVR over Steam Link, Link, Air Link or Virtual Desktop)"
)
TO_RUN = {  # a word of a runtime's name or files -> what has to run before it opens
    "monado": "start its service, `monado-service`, and leave it running",
    "wivrn": "start its server, `wivrn-server` or its window, and connect the headset",
    "steam": "start SteamVR and connect the headset",
    "oculus": "start Meta's Link program, connect the headset and put it on",
    "virtualdesktop": "connect the headset to Virtual Desktop's Streamer",
}
SYSTEM = "/etc"
LARGEST_MANIFEST = 100_000  # bytes


class NoHeadset(RuntimeError):
    """Nothing to show a scene in.  The message names the runtime and says what to do."""


class Lost(RuntimeError):
    """The runtime, or our session with it, went away while it ran."""


class Instance:
    """An open instance and its headset; use it in a `with`.

    `xr`: pyopenxr, loaded only here; `handle`, `system`: what its functions want; `runtime`: name
    and version, `headset`: what the runtime calls it; `extensions`: those that are switched on.

    insets: four views a frame are wanted, which the newer OpenXR has without an extension.
    """

    def __init__(self, insets: bool = False) -> None:
        self.xr = xr = load()
        self.runtime, what_to_run = active_runtime()
        self.extensions = self._choose_extensions()
        newer = insets and QUAD_VIEWS not in self.extensions
        try:
            with self.asked("open"):
                self.handle = self._create(newer)
        except xr.exception.ErrorResult as error:
            raise NoHeadset(
                f"{self.runtime} refuses us ({type(error).__name__}); update it, or {HOW_TO}."
            ) from None
        except Lost as failed:  # its library answers, what it talks to does not run
            raise NoHeadset(f"{str(failed)[:-1]}; {what_to_run}, then start again.") from None
        try:
            self._name_runtime()
            self._find_headset()
        except BaseException:
            self.close()
            raise

    def _create(self, newer: bool) -> Any:
        """By the newer OpenXR where the runtime speaks it, else by the one that all speak."""
        xr = self.xr
        for version in (API_OF_INSETS, API) if newer else (API,):
            info = xr.InstanceCreateInfo(
                application_info=xr.ApplicationInfo(NAME, 1, NAME, 0, xr.Version(*version)),
                enabled_extension_names=list(self.extensions),
            )
            try:
                return xr.create_instance(info)
            except xr.exception.ApiVersionUnsupportedError:
                if version == API:
                    raise
        raise AssertionError("the last version is API")

    def _choose_extensions(self) -> tuple[str, ...]:
        with self.asked("list its extensions"):
            found = self.xr.enumerate_instance_extension_properties()
        offered = {_text(each.extension_name) for each in found}
        chosen = tuple(name for name in (*DRAWING, *WANTED) if name in offered)
        if not set(chosen) & set(DRAWING):
            raise NoHeadset(
                f"{self.runtime} takes no OpenGL pictures; SteamVR's does, for the same headsets: "
                "make it the active one."
            )
        return chosen

    def _name_runtime(self) -> None:
        with self.asked("say its name"):
            properties = self.xr.get_instance_properties(self.handle)
        version = self.xr.Version(properties.runtime_version)
        numbers = f"{version.major}.{version.minor}.{version.patch}"
        self.runtime = f"the OpenXR runtime {_text(properties.runtime_name)} {numbers}"

    def _find_headset(self) -> None:
        xr = self.xr
        try:
            with self.asked("name its headset"):
                wanted = xr.SystemGetInfo(xr.FormFactor.HEAD_MOUNTED_DISPLAY)
                self.system = xr.get_system(self.handle, wanted)
                properties = xr.get_system_properties(self.handle, self.system)
        except xr.exception.FormFactorUnavailableError:
            raise NoHeadset(
                f"{self.runtime} finds no headset; connect it, switch it on, and start again."
            ) from None
        except xr.exception.FormFactorUnsupportedError:
            raise NoHeadset(f"{self.runtime} is not for headsets; {HOW_TO}.") from None
        self.headset = _text(properties.system_name)

    @contextmanager
    def asked(self, what: str) -> Iterator[None]:
        """Turns what a runtime answers when it is absent, broken or gone into a sentence."""
        errors = self.xr.exception
        try:
            yield
        except errors.RuntimeUnavailableError:
            raise NoHeadset(_no_runtime()) from None
        except (errors.InstanceLostError, errors.SessionLostError) as error:
            raise Lost(f"{self.runtime} went away ({type(error).__name__}).") from None
        except (errors.RuntimeFailureError, errors.InitializationFailedError) as error:
            raise Lost(f"{self.runtime} failed to {what} ({type(error).__name__}).") from None

    def close(self) -> None:
        try:
            self.xr.destroy_instance(self.handle)
        except self.xr.exception.ErrorResult:
            pass  # lost already: nothing is left to give back

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, *failure) -> None:
        self.close()


def load():
    """pyopenxr; NoHeadset where it is absent or knows nothing of this system."""
    if not (sys.platform.startswith("linux") or sys.platform == "win32"):
        raise NoHeadset("OpenXR runs on Windows and Linux; there is none for this system.")
    os.environ.setdefault("XR_LOADER_DEBUG", "none")  # its lines on stderr say what we say better
    try:
        import xr
    except (ImportError, OSError) as missing:
        raise NoHeadset(
            f"the package pyopenxr cannot be loaded ({missing}); {package_words('pyopenxr')} "
            "installs it, and Linux needs libgl1."
        ) from missing
    return xr


def active_runtime() -> tuple[str, str]:
    """What the active runtime is called by its manifest, which is read where OpenXR's loader looks
    for it, and what has to run for it.
    """
    for path in manifests():
        about = saved_object(path, LARGEST_MANIFEST).get("runtime")
        if not isinstance(about, dict):
            continue
        name = one_line(str(about.get("name") or ""), LONGEST_NAME)
        said = f"{name} {about.get('library_path')} {path.name}".replace("-", "").lower()
        what = next((what for word, what in TO_RUN.items() if word in said), HOW_TO)
        return (f"the OpenXR runtime {name}" if name else f"the OpenXR runtime of {path}"), what
    return "the active OpenXR runtime", HOW_TO


def manifests() -> list[Path]:
    """Where the active runtime's manifest may lie, the first that is there counts."""
    if named := os.environ.get("XR_RUNTIME_JSON"):
        return [Path(named)]
    if sys.platform == "win32":
        import winreg

        try:
            with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, r"SOFTWARE\Khronos\OpenXR\1") as key:
                return [Path(winreg.QueryValueEx(key, "ActiveRuntime")[0])]
        except OSError:
            return []
    home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    folders = [home, *os.environ.get("XDG_CONFIG_DIRS", "/etc/xdg").split(":"), SYSTEM]
    names = (f"active_runtime.{platform.machine()}.json", "active_runtime.json")
    return [Path(folder, "openxr/1", name) for folder in folders for name in names]


def _no_runtime() -> str:
    named = os.environ.get("XR_RUNTIME_JSON")
    if named:
        return (
            f"the OpenXR runtime that XR_RUNTIME_JSON names, {named}, cannot be loaded; {HOW_TO}."
        )
    return f"no OpenXR runtime is active on this machine; {HOW_TO}."


def _text(name: bytes | str) -> str:
    return name.decode(errors="replace") if isinstance(name, bytes) else str(name)
