"""What an eye's lens does not show (XR_KHR_visibility_mask): read once, and when it has changed."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shapeshift.scene.pose import HiddenMesh, View
from shapeshift.vr.frame import SIDES
from shapeshift.vr.openxr.instance import VISIBILITY_MASK, Instance

# Which views a session has: one an eye, or for each eye a wide one and a sharp inset in it.
#
# The four views of XR_VARJO_quad_views and of OpenXR 1.1 (PRIMARY_STEREO_WITH_FOVEATED_INSET, the
# same number): left, right, left inset, right inset.  Where the insets are, and how many pixels
# either has, says the runtime.

EYES = len(SIDES)
VIEWS_WITH_INSETS = 2 * EYES
SAME_TURN = 1e-6  # that a quaternion's numbers may differ by: the runtime's are of float32


@dataclass(frozen=True)
class ViewConfiguration:
    """`kind`: XrViewConfigurationType; `views`: what the runtime recommends for each."""

    kind: Any
    views: tuple[Any, ...]
    offers_insets: bool  # whether the runtime could show four, too

    @property
    def has_insets(self) -> bool:
        return len(self.views) == VIEWS_WITH_INSETS


def choose_views(instance: Instance, insets: bool) -> ViewConfiguration:
    """Four views where they are wanted and offered, else one an eye."""
    with instance.asked("say which views it has"):
        return _chosen(instance, insets)


def _chosen(instance: Instance, insets: bool) -> ViewConfiguration:
    xr, system = instance.xr, (instance.handle, instance.system)
    kinds = xr.ViewConfigurationType
    stereo, four = kinds.PRIMARY_STEREO, kinds.PRIMARY_STEREO_WITH_FOVEATED_INSET

    def views_of(kind: Any) -> tuple[Any, ...]:
        return tuple(xr.enumerate_view_configuration_views(*system, kind))

    offered = int(four) in {int(each) for each in xr.enumerate_view_configurations(*system)}
    found = views_of(four) if offered else ()
    offered = len(found) == VIEWS_WITH_INSETS
    if insets and offered:
        return ViewConfiguration(four, found, True)
    return ViewConfiguration(stereo, views_of(stereo), offered)


def with_insets(views: Sequence[View]) -> tuple[View, ...]:
    """The views with each inset as the part of its wide view that it is, where it is turned alike:
    so splats at the edge of sight have the same shape in both.
    """
    wide, insets = views[:EYES], views[EYES:]
    made = [
        replace(inset, whole=view.tangents) if _turned_alike(inset, view) else inset
        for inset, view in zip(insets, wide, strict=False)
    ]
    return (*wide, *made)


def _turned_alike(a: View, b: View) -> bool:
    p, q = a.world_from_eye.wxyz, b.world_from_eye.wxyz
    return bool(min(np.abs(p - q).max(), np.abs(p + q).max()) <= SAME_TURN)


HIDDEN = 1  # XR_VISIBILITY_MASK_TYPE_HIDDEN_TRIANGLE_MESH_KHR
MOST = 1 << 20  # corners: a mesh with more is no mesh
# Monado 25.0 calls what a headset's driver need not have, and ends with the program
# (oxr_session_get_visibility_mask, of its remote headset); what it has is four small corners.
CRASHES = "Monado"


class VisibilityMasks:
    """`of(i)`: the hidden mesh of view i, None where the runtime tells none."""

    def __init__(self, instance: Instance, session: Any, shown: ViewConfiguration) -> None:
        self._instance, self._session, self._shown = instance, session, shown
        self._meshes: list[HiddenMesh | None] = [None] * len(shown.views)
        self.ask()

    def of(self, i: int) -> HiddenMesh | None:
        return self._meshes[i]

    def ask(self) -> None:
        """Reads the meshes of all views anew."""
        xr, instance = self._instance.xr, self._instance
        if VISIBILITY_MASK not in instance.extensions or CRASHES in instance.runtime:
            return
        address = xr.get_instance_proc_addr(instance.handle, "xrGetVisibilityMaskKHR")
        ask = ctypes.CFUNCTYPE(
            ctypes.c_int, xr.Session, ctypes.c_int, ctypes.c_uint32, ctypes.c_int, ctypes.c_void_p
        )(ctypes.cast(address, ctypes.c_void_p).value or 0)
        kind, views = int(self._shown.kind), range(len(self._meshes))

        def fill(i: int, mask: Any) -> bool:
            return ask(self._session, kind, i, HIDDEN, ctypes.addressof(mask)) == 0

        self._meshes = [read_mask(xr, lambda mask, i=i: fill(i, mask)) for i in views]


def read_mask(xr: Any, fill: Any) -> HiddenMesh | None:
    """The mesh that `fill` writes into an xr.VisibilityMaskKHR: how much first, then all of it.

    None where there is none, or what there is is no mesh.
    """
    mask = xr.VisibilityMaskKHR()
    if not fill(mask):
        return None
    corners, numbers = int(mask.vertex_count_output), int(mask.index_count_output)
    if not (0 < corners <= MOST and 0 < numbers <= MOST):
        return None
    places, order = (xr.Vector2f * corners)(), (ctypes.c_uint32 * numbers)()
    mask.vertex_capacity_input, mask.index_capacity_input = corners, numbers
    mask.vertices = ctypes.cast(places, ctypes.POINTER(xr.Vector2f))
    mask.indices = ctypes.cast(order, ctypes.POINTER(ctypes.c_uint32))
    if not fill(mask):
        return None
    tangents = np.array([(each.x, each.y) for each in places], np.float64)
    which = np.array(order, np.int64)[: numbers - numbers % 3]
    if not (np.isfinite(tangents).all() and which.size and which.max() < corners):
        return None
    return HiddenMesh(tangents[which].reshape(-1, 3, 2))
