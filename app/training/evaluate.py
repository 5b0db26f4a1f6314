"""launch.py eval: PSNR and SSIM of a scene on the held-out photos of a capture."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL
from shapeshift.app.opening import ReadingOptions, open_capture, open_model
from shapeshift.app.terminal import open_console, print_json, say

NAMED = 3  # photos that a sentence names

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Compare a scene with the held-out photos of a capture (every 8th, unless it says which)."""

    scene: Annotated[Path, POSITIONAL]
    """A package, or any other file of splats."""
    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos."""
    modality: Annotated[str | None, MODALITY] = None
    """Only this modality of the capture, for a scene that was trained on that alone.  Default:
    all."""
    json: bool = False
    """Print the result as JSON on standard output."""
    downscale: int | None = None
    """Divide the photos' sides by this number.  Default: as in the training, if the scene knows it,
    else such that neither exceeds 640 pixels."""
    masks: Literal["auto", "object", "valid", "ignore"] = "auto"
    """What a mask means: object, nothing is outside it; valid, what is outside is unknown; ignore,
    masks are not used.  auto: as in the training, if the scene knows it, else what the capture or
    the masks' shapes say, as `train` does."""
    background: Literal["auto", "black", "white", "gray"] = "auto"
    """Colour behind everything.  auto: the capture's own, else black."""
    vgg: Annotated[Path | None, EXPERT] = None
    """An ONNX file of VGG16's first layers: measures a distance of its features, too.  It is no
    LPIPS, and compares only with figures of the same file.  Default: not measured."""


def run(options: Options) -> int:
    from shapeshift.app.errors import UsageError
    from shapeshift.app.progress import working
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.document.scene_file import is_scene_file
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics
    from shapeshift.training.evaluation.evaluate import evaluate_model, report
    from shapeshift.training.evaluation.vgg_distance import VggDistance

    started = time.perf_counter()
    if is_scene_file(options.scene):
        raise UsageError(
            f"{options.scene} is a scene file of objects, and photos are of one scene as it was "
            "trained; name the model of one object."
        )
    if options.downscale is not None and options.downscale < 1:
        raise UsageError(f"--downscale is {options.downscale}; it has to be at least 1.")
    distance = None if options.vgg is None else VggDistance(options.vgg)
    capture = open_capture(options.capture, options.memory or None)
    if options.modality is not None:
        capture = only(capture, options.modality)
    model = open_model(options.scene, options)
    capture = with_extrinsics(capture, rig_of(model.provenance))
    downscale = options.downscale or trained_downscale(model.provenance)
    masks = trained_masks(model.provenance, options.masks)
    with working("comparing with the photos"):
        scores = evaluate_model(
            open_device(), model, capture, downscale, masks, options.background,
            distance,
        )  # fmt: skip
    result = report(options.scene, scores, started)
    if distance is not None:
        result["vgg_file"] = distance.name
    print_table(result)
    for line in said_of_unknown(result["modalities"]):
        say(line)
    if options.downscale is None and (downscale or 1) > 1:
        say(
            f"Photos made {downscale} times smaller, as in the training; --downscale 1 takes them "
            "whole."
        )
    if options.json:
        print_json(result)
    return 0


def said_of_unknown(modalities: dict[str, dict]) -> list[str]:
    """A sentence for each modality with pixels that have no value.  modalities: of `report`."""
    said = []
    for name, row in modalities.items():
        if row.get("unknown"):
            said.append(f"{name}: {row['unknown']:.2%} of the pixels have no value; not counted.")
        if blank := row.get("photos_without_value"):
            said.append(
                f"{name}: no pixel of {', '.join(blank[:NAMED])} has a value; "
                f"{len(blank)} held-out photos are in no figure."
            )
    return said


def trained_downscale(provenance: dict) -> int | None:
    """What the sides of the photos were divided by that a scene was trained on; None: not known.

    At other sizes its splats are too thin or too thick, and the figures say that instead.
    """
    factor = provenance.get("downscale")
    return factor if type(factor) is int and 1 <= factor <= 64 else None


def trained_masks(provenance: dict, asked: str) -> str:
    """What masks are taken for: as asked; for auto as a scene was trained, as far as that is
    known."""
    settings = provenance.get("settings")
    trained = settings.get("masks") if isinstance(settings, dict) else None
    return trained if asked == "auto" and trained in ("object", "valid", "ignore") else asked


def only(capture: "Capture", name: str) -> "Capture":
    """The capture with one of its modalities.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    stops = tuple(stop for stop in capture.stops if stop.name == name)
    if not stops:
        names = ", ".join(stop.name for stop in capture.stops)
        raise UsageError(f"the capture has no modality '{name}'; it has {names}.")
    photos = tuple(photo for photo in capture.photos if photo.modality == name)
    return replace(capture, stops=stops, photos=photos)


def print_table(result: dict) -> None:
    from rich.table import Table

    vgg = ["VGG distance"] if "vgg_file" in result else []
    depth = any("depth_error" in score for score in result["modalities"].values())
    still = any("whole_db" in score for score in result["modalities"].values())
    more = [*(["whole photo"] if still else []), *vgg, *(["depth error %"] if depth else [])]
    table = Table(
        "modality", "PSNR dB", "median", "fitted", "SSIM", *more, "photos", "splats alive"
    )
    worst = {}
    for name, score in result["modalities"].items():
        photo, db = min(score["psnr_db_each"].items(), key=lambda pair: pair[1])
        worst[photo] = f"{photo} {db:.1f} dB"
        row = [f"{score[key]:.2f}" for key in ("psnr_db", "median_db", "fitted_db")]
        row.append(f"{score['ssim']:.4f}")
        if still:
            row.append(f"{score['whole_db']:.2f}" if "whole_db" in score else "")
        row += [f"{score['vgg_distance']:.4f}"] if vgg else []
        if depth:
            row.append(f"{100 * score['depth_error']:.2f}" if "depth_error" in score else "")
        table.add_row(name, *row, str(score["photos"]), f"{result['alive'][name]:,}")
    console = open_console()
    console.print(table)
    console.print(f"worst: {', '.join(worst.values())}", highlight=False, markup=False)
    console.print(f"{result['bytes']:,} bytes on disk, {result['seconds']:.1f} s")
