"""What photos say of a model: how alike each is, what every anchor gives them, and outlines."""

from itertools import combinations

import numpy as np

from shapeshift.rasterizer.raster import rasterize_backward
from shapeshift.runtime_models.model import AnchorModel, Model
from shapeshift.training.evaluation.evaluate import ModelRenderer, stop_for
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.photos import BLACK, LoadedPhoto

Color = tuple[float, float, float]
COVERED = 0.5  # of a pixel, from where on it lies inside of an outline


def view_psnr(
    device, model: Model, photos: list[LoadedPhoto], stops: tuple, background: Color
) -> dict[str, np.ndarray]:
    """PSNR in dB of every photo, in their order, by modality."""
    renderer, found = ModelRenderer(device, model), {}
    for stop in stops:
        mine = [p for p in photos if p.modality == stop.name]
        renderer.set_control(stop_for(model, stop).x)
        found[stop.name] = np.array(
            [psnr(renderer.picture(p.view, background), p.over(background), p.weight) for p in mine]
        )
    return found


def largest_contribution(
    device, model: AnchorModel, photos: list[LoadedPhoto], stops: tuple
) -> np.ndarray:
    """(A,) pixels that an anchor's splats make up in the photo where they make up most.

    A splat makes up the sum of alpha T over the picture of its own stop; what hides behind others,
    or lies outside of every photo, makes up nothing.
    """
    renderer, most = ModelRenderer(device, model), np.zeros(len(model.anchors))
    for stop in stops:
        renderer.set_control(stop_for(model, stop).x)
        for photo in photos:
            if photo.modality != stop.name:
                continue
            projected, tiles, frame = renderer.draw(photo.view, BLACK)
            grad = device.zeros(frame.image.shape)
            record = rasterize_backward(
                device, projected, tiles, frame, grad, None, absolute=False, weight=True
            )
            weight = device.download(record)[:, 11].reshape(len(most), -1)
            most = np.maximum(most, weight.sum(axis=1, dtype=np.float64))
    return most


def outline(renderer: ModelRenderer, photo: LoadedPhoto) -> np.ndarray:
    """(H, W) bool: where the model at the renderer's control value covers the photo's view."""
    _, _, frame = renderer.draw(photo.view, BLACK)
    return 1 - renderer.device.download(frame.transmittance) > COVERED


def outline_ious(
    device, model: Model, photos: list[LoadedPhoto], stops: tuple
) -> dict[tuple[str, str], float]:
    """Mean over the photos' views of (both) / (either) of the outlines at every pair of stops.

    1: the stops have one shape, as far as outlines tell; 0: nothing in common.
    """
    renderer, outlines = ModelRenderer(device, model), {}
    for stop in stops:
        renderer.set_control(stop_for(model, stop).x)
        outlines[stop.name] = [outline(renderer, photo) for photo in photos]
    found = {}
    for a, b in combinations(outlines, 2):
        both = [(x & y).sum() for x, y in zip(outlines[a], outlines[b], strict=True)]
        either = [(x | y).sum() for x, y in zip(outlines[a], outlines[b], strict=True)]
        seen = [i / u for i, u in zip(both, either, strict=True) if u]
        found[a, b] = float(np.mean(seen)) if seen else 1.0
    return found
