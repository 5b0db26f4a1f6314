"""Photos as targets of the losses, on the device; as many are kept as fit into memory."""

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.losses.losses import ImageLoss, Target
from shapeshift.training.losses.surface_losses import (
    DepthLoss,
    DepthTarget,
    DepthTerm,
    NormalLoss,
    NormalTarget,
    NormalTerm,
    ShapeTerm,
)
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.exposure import NONE, Exposures

CACHE_BYTES = 2 << 30  # of finished targets; beyond it they are made again at every use ...
CACHE = 0.25  # ... and beyond that part of the memory that files may take


class Targets:
    """Makes loss targets of photos and keeps as many as fit."""

    def __init__(self, device, most: int | None = None) -> None:
        """most: bytes that finished targets may take, where photos have to do with little."""
        self.device = device
        self.losses: dict[tuple[int, int], ImageLoss] = {}
        self.kept: dict[tuple, Target] = {}
        self.kept_depths: dict[tuple, DepthTarget] = {}
        self.depth_losses: dict[tuple[int, int], DepthLoss] = {}
        self.kept_normals: dict[tuple, NormalTarget] = {}
        self.normal_losses: dict[tuple[int, int], NormalLoss] = {}
        most = CACHE_BYTES if most is None else min(CACHE_BYTES, most)
        self.bytes, self.most = 0, min(most, int(CACHE * Memory().most))

    def loss(self, photo: LoadedPhoto) -> ImageLoss:
        """The image loss of the photo's size."""
        size = photo.view.size
        if size not in self.losses:
            self.losses[size] = ImageLoss(self.device, size)
        return self.losses[size]

    def target(
        self, photo: LoadedPhoto, background: tuple[float, float, float],
        exposures: Exposures | None = None, image: object = None,
    ) -> Target:  # fmt: skip
        """The photo over a background; kept unless the photo shows the background.

        exposures: what its colours are divided by, once they have looked at what is drawn of it,
        the image (3, H, W) on the device, where there is one.
        """
        key = (photo.modality, photo.name, photo.view.size)
        rgba, gain = None, NONE
        if exposures is not None:
            if image is not None:
                rgba = self.device.upload(photo.rgba)
                exposures.update(photo, image, rgba)
            gain = exposures.gain(photo)
        if gain == NONE and key in self.kept:
            return self.kept[key]
        rgba = self.device.upload(photo.rgba) if rgba is None else rgba
        target = self.loss(photo).target(rgba, background, photo.weight, gain)
        if gain != NONE:
            return target
        if not photo.see_through and self.bytes + target.bytes <= self.most:
            self.kept[key] = target
            self.bytes += target.bytes
        return target

    def shape_term(
        self, photo: LoadedPhoto, settings: TrainSettings | PlainSettings
    ) -> ShapeTerm | None:
        """What is to be learned of the shape from the photo's depth and normal map, if any."""
        depth = self.depth_term(photo, settings.depth_share)
        return self.normal_term(photo, settings.normal_share, depth) or depth

    def normal_term(
        self, photo: LoadedPhoto, share: float, depth: DepthTerm | None
    ) -> NormalTerm | None:
        """What is to be learned from the photo's normal map, beside its depth; None: nothing."""
        if not (share > 0 and photo.has_normals) or (normals := photo.normals) is None:
            return None
        size, key = photo.view.size, (photo.modality, photo.name, photo.view.size)
        if size not in self.normal_losses:
            self.normal_losses[size] = NormalLoss(self.device, size)
        loss = self.normal_losses[size]
        target = self.kept_normals.get(key) or loss.target(normals, photo.view)
        if key not in self.kept_normals and self.bytes + target.bytes <= self.most:
            self.kept_normals[key] = target
            self.bytes += target.bytes
        return NormalTerm(loss, target, share, depth) if target.known else None

    def depth_term(self, photo: LoadedPhoto, share: float) -> DepthTerm | None:
        """What is to be learned from the photo's depth; None where it has none or share is 0."""
        if not (share > 0 and photo.has_depth) or (depth := photo.depth) is None:
            return None
        size, key = photo.view.size, (photo.modality, photo.name, photo.view.size)
        if size not in self.depth_losses:
            self.depth_losses[size] = DepthLoss(self.device, size)
        loss = self.depth_losses[size]
        target = self.kept_depths.get(key) or loss.target(depth)
        if key not in self.kept_depths and self.bytes + target.bytes <= self.most:
            self.kept_depths[key] = target
            self.bytes += target.bytes
        return DepthTerm(loss, target, share) if target.known else None
