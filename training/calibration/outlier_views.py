"""Training photos that fit a trained scene much worse than the others, by name, and why."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.train import Trainer

LEAST_DB = 4.0  # below the median of its modality: what the worst of good photos are not
SPREADS = 4.0  # of the deviations from that median, as standard deviations of a normal spread
FEWEST = 5  # photos of a modality: among fewer none stands out
SHOWN = 20  # names at most
LOOKED_AT = 8  # photos of a modality that tell whether there is any picture
ONE_COLOR = 0.02  # of a colour's range, by which photos of one colour differ within themselves
STEEP = (0.4, 2.5)  # contrast that another exposure or white balance may have
Tracked = Callable[[list[LoadedPhoto]], Iterable[LoadedPhoto]]


@dataclass(frozen=True)
class OutlierView:
    name: str  # of the file
    modality: str
    psnr_db: float
    median_db: float  # of the training photos of its modality
    exposure: bool  # other brightness or colours alone explain it; else its pose, or what it shows

    def sentence(self) -> str:
        why = (
            "other brightness or colours explain it: check its exposure and white balance"
            if self.exposure
            else "check its pose and that it shows the same scene; a close-up may need a longer run"
        )
        return (
            f"{self.name} ({self.modality}) fits with {self.psnr_db:.1f} dB, the others with "
            f"{self.median_db:.1f} dB; {why}."
        )


def recolored(image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None) -> np.ndarray:
    """(H, W, 3) the image with a gain and an offset a channel that bring it nearest to the photo.

    Gains beyond STEEP are none: with a gain of 0 any picture is near to any photo.
    """
    out = np.empty_like(image)
    each = np.ones(image.shape[:2]) if weight is None else weight
    for channel in range(3):
        have, want = image[..., channel], photo[..., channel]
        mean_have, mean_want = (np.average(v, weights=each) for v in (have, want))
        spread = np.average((have - mean_have) ** 2, weights=each)
        shared = np.average((have - mean_have) * (want - mean_want), weights=each)
        gain = np.clip(shared / max(float(spread), 1e-9), *STEEP)
        out[..., channel] = np.clip(gain * (have - mean_have) + mean_want, 0, 1)
    return out


def judge(
    modality: str, photos: list[LoadedPhoto], fits: list[tuple[float, float]]
) -> list[OutlierView]:
    """Those that stand out, worst first.  fits: (dB, dB after recoloring) of every photo."""
    if len(fits) < FEWEST:
        return []
    values = np.array([fit for fit, _ in fits])
    median = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - median)))
    limit = median - max(LEAST_DB, SPREADS * spread)
    out = [
        OutlierView(
            photo.name, modality, fit, median, bool(again >= limit and again - fit >= LEAST_DB)
        )
        for photo, (fit, again) in zip(photos, fits, strict=True)
        if not fit >= limit
    ]
    return sorted(out, key=lambda outlier: outlier.psnr_db)


def drawn(trainer: Trainer, photo: LoadedPhoto) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) what the model shows of a photo, and the photo, over the same background."""
    background = trainer.schedule.background or (0.5, 0.5, 0.5)
    drawing = trainer.step.draw(
        trainer.poses.view(photo), trainer.control(photo.modality), background
    )
    image = trainer.device.download(drawing.frame.image).transpose(1, 2, 0)
    return image, photo.over(background)


def failed_modalities(trainer: Trainer) -> list[str]:
    """A sentence where pictures are no nearer to the photos than a sheet of one colour is, and one
    where the photos are such a sheet.
    """
    lost, empty = [], []
    for modality, photos in trainer.schedule.photos.items():
        won, plain = [], True
        for photo in photos[:: -(-len(photos) // LOOKED_AT)]:
            image, wanted = drawn(trainer, photo)
            each = np.ones(wanted.shape[:2]) if photo.weight is None else photo.weight
            mean = np.average(wanted.reshape(-1, 3), axis=0, weights=each.ravel())
            flat = np.broadcast_to(mean, wanted.shape)
            plain &= not np.abs(wanted - flat)[each > 0].max(initial=0) > ONE_COLOR
            won.append(psnr(image, wanted, photo.weight) - psnr(flat, wanted, photo.weight))
        if plain:
            empty.append(modality)
        elif not np.median(won) > 0:
            lost.append(modality)
    said = []
    if empty:
        said.append(
            f"{', '.join(empty)}: the photos show one colour all over; look whether they are what "
            "you meant."
        )
    if lost:
        said.append(
            f"{', '.join(lost)}: the pictures are no nearer to the photos than one colour all "
            "over; train longer, or take other --points (hull where the background is known), and "
            "check that photos and poses belong together."
        )
    return said


def find_outlier_views(trainer: Trainer, tracked: Tracked = iter) -> list[OutlierView]:
    """Draws every training photo of a trained model once; those that stand out in their modality.

    A model that is far from trained fits all photos badly, so few stand out; but then close-ups,
    which are learned last, do.  tracked: gives the photos one by one, and may tell how many.
    """
    by_modality = trainer.schedule.photos
    fits: dict[str, list[tuple[float, float]]] = {modality: [] for modality in by_modality}
    for photo in tracked([photo for photos in by_modality.values() for photo in photos]):
        image, wanted = drawn(trainer, photo)
        again = recolored(image, wanted, photo.weight)
        fit = psnr(image, wanted, photo.weight), psnr(again, wanted, photo.weight)
        fits[photo.modality].append(fit)
    return [
        outlier
        for modality, photos in by_modality.items()
        for outlier in judge(modality, photos, fits[modality])
    ]


def report(found: list[OutlierView]) -> list[str]:
    """A sentence for each of them, as far as anybody would read."""
    lines = [outlier.sentence() for outlier in found[:SHOWN]]
    if len(found) > SHOWN:
        lines.append(f"... and {len(found) - SHOWN} more.")
    return lines
