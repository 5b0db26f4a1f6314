"""Which views a session has: one an eye, or for each eye a wide one and a sharp inset in it.

The four views of XR_VARJO_quad_views and of OpenXR 1.1 (PRIMARY_STEREO_WITH_FOVEATED_INSET, the
same number): left, right, left inset, right inset.  Where the insets are, and how many pixels
either has, says the runtime.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.vr.frame import SIDES
from shapeshift.vr.openxr.instance import Instance

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
