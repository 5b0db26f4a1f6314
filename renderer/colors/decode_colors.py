"""Runs one set of colours of all objects, where an eye moved or another look is asked for."""

import numpy as np

from shapeshift.renderer.colors.color_cache import color_key
from shapeshift.renderer.colors.tint import tinted
from shapeshift.renderer.colors.two_looks import Look
from shapeshift.renderer.colors.wanted import wanted_anchors, wanted_of_follower, wanted_splats
from shapeshift.renderer.cut import place_splats, restore_shapes
from shapeshift.renderer.decoded_object import DecodedObject
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene


def decode_colors(
    drawing: Drawing, settings: RenderSettings, objects: list[DecodedObject], which: int,
    views: list[View], scene: Scene, looks: list[Look], at_once: bool,
) -> tuple[int, int]:  # fmt: skip
    """Set `which`, that the drawing decodes into, for the middle of some eyes, where it moved.

    And the geometry of those that follow the eye: as often.  Returns how often geometry and colours
    ran.
    """
    eye_world = np.mean([v.world_from_eye.position for v in views], axis=0)
    degrees, ran = settings.recolor_degrees, [0, 0]
    for i, (obj, decoded) in enumerate(zip(scene.objects, objects, strict=True)):
        if not obj.seen:
            continue
        colored = decoded.colored[which]
        if colored.is_done and obj.tint is colored.tint:
            continue  # a thousand copies are asked every frame
        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        eye = object_from_world[:3, :3] @ eye_world + object_from_world[:3, 3]
        key = color_key(obj.model, decoded.version, eye)
        stale = colored.is_stale(key, degrees, nearer=follows_eye(obj.model))
        follows = follows_eye(obj.model)
        if follows:
            due, wanted = wanted_of_follower(settings, obj, colored, stale, views)
            if due:
                colored.key, colored.anchors = key, wanted
        else:
            if isinstance(obj.model, SplatLayers):
                looked = looks[i][0].heats or looks[i][1] or obj.tint or colored.tint
                asked = not looked and (stale or colored.anchors is not None)
                seen = drawing.seen_splats(i, views, settings) if asked else None
                wanted = wanted_splats(colored, stale, seen)
            else:
                wanted = wanted_anchors(drawing, settings, i, obj, decoded, colored, stale, views)
            due = colored.mark_colored(key, wanted, stale)  # else all seen have their colours
        if not due and obj.tint is colored.tint:
            continue
        with tinted(drawing, i, obj, colored):
            if due and follows:
                restore_shapes(drawing, i, decoded)
                drawing.decode_geometry(i, decoded.x, eye, wanted)
                ran[0] += 1
                place_splats(drawing, i, obj, decoded)
            if due:
                shade, grade = looks[i]
                drawing.decode_color(i, shade, eye, wanted, at_once, grade)
                ran[1] += 1
    return ran[0], ran[1]
