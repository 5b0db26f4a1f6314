"""What a new stop is learned from, as the options of `style` say it."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from shapeshift.app.errors import UsageError
from shapeshift.app.training.style_options import Options, Shape
from shapeshift.runtime_models.model import AnchorModel

if TYPE_CHECKING:
    import numpy as np

    from shapeshift.scene.pose import View
    from shapeshift.training.styles.style_pictures import StylePictures
    from shapeshift.training.styles.style_rules import Rule

MOST_STYLES = 64  # of a blend
NAMES = 24  # letters of a name that comes from a file's


def usual_name(options: Options) -> str:
    """What a stop is called that was given no name."""
    file = options.image or options.network or options.pictures
    words = [options.shape.capitalize()] if options.shape else []
    if options.text:
        words.append(" ".join(options.text.split())[:NAMES].strip() or "style")
    elif file is not None:
        words.append(file.stem[:NAMES].strip() or "style")
    name = " ".join(words)
    return name[:1].upper() + name[1:]


def pictures_and_views(
    options: Options, model: AnchorModel, painted: bool = False
) -> "tuple[StylePictures | None, list[View]]":
    """Who paints the stop, None where a shape alone is asked for, and the views that are painted.

    painted: the caller has a painter of its own.  Raises UsageError and BadFile.
    """
    from shapeshift.training.styles.carried_pictures import CarriedPictures, PictureFiles, files_for
    from shapeshift.training.styles.train_stop import dome_views, resized_views

    looks = looks_of(options)
    if not (painted or looks or options.network or options.pictures):
        return None, []
    count, longest = views_and_size(options)
    names: tuple[str, ...] = ()
    if options.cameras is None:
        views = dome_views(model, count, (longest, round(longest * 3 / 4)))
    else:
        cameras = read_cameras(options, options.cameras)
        views, names = resized_views(cameras.views, longest), cameras.names
    if painted:
        return None, views
    if options.pictures is not None:
        return CarriedPictures(PictureFiles(files_for(options.pictures, names))), views
    return looks or CarriedPictures(network_of(options)), views


def network_of(options: Options) -> "StylePictures":
    """The network that --network names, with its style."""
    from shapeshift.training.styles.carried_pictures import read_picture
    from shapeshift.training.styles.image_network import ImageNetwork, encode_style

    assert options.network is not None, "checked before"
    weights, code = read_weights(options.weights), None
    if options.image is not None and options.encoder is not None:
        code = encode_style(options.encoder, read_picture(options.image))
    return ImageNetwork(options.network, weights, code)


def read_weights(text: str) -> dict[int, float]:
    """Style number -> weight, of "3" or "3=0.5,12=0.5".  Raises UsageError."""
    found: dict[int, float] = {}
    for word in filter(None, text.split(",")):
        number, _, weight = word.partition("=")
        try:
            index, value = int(number), float(weight or 1)
        except ValueError:
            index, value = -1, math.nan
        if (
            not (index >= 0 and 0 <= value <= 10 and index not in found)
            or len(found) >= MOST_STYLES
        ):
            raise UsageError(
                f"--weights is '{text[:60]}'; numbers of styles, each once, and weights of 0 to "
                "10 are wanted, as 3=0.5,12=0.5."
            )
        found[index] = value
    return found


# Looks from a style picture or from words, as the options of `style` say them.

MADE_SIDE = 256  # pixels of a picture of our own
LONGEST_SIDE = 384  # pixels to which a style picture is made smaller: strokes of some ten pixels


def check_looks(options: Options) -> None:
    """Raises UsageError for options of pictures and words that do not go together."""
    by_code = options.image is not None and options.network is not None
    if by_code != (options.encoder is not None):
        raise UsageError(
            "--encoder makes the code of --image for --network; give all three, or not the encoder."
        )
    if options.image and not (options.network or options.vgg or options.clip_model):
        raise UsageError(
            "--image needs --vgg, an ONNX file of VGG16, for its strokes and colours, or "
            "--clip-model for what it means."
        )
    if options.text and options.image:
        raise UsageError("--text and --image both say the style; leave one of them out.")
    if options.vgg and options.clip_model:
        raise UsageError("--vgg and --clip-model are two ways; leave one of them out.")
    if options.clip_model and not (options.text or options.image):
        raise UsageError("--clip-model needs --text or --image, which say the style.")
    painters = [name for name, given in (("--network", options.network),
                                         ("--pictures", options.pictures)) if given]  # fmt: skip
    if painters and (options.text or options.vgg or options.clip_model):
        raise UsageError(f"{painters[0]} paints the stop already; leave out --text, --vgg and "
                         "--clip-model, or it.")  # fmt: skip
    if options.vgg and not (options.image or options.text):
        raise UsageError("--vgg needs --image, the style picture.")
    if options.quality == "preview" and not options.vgg:
        raise UsageError("--quality preview is of --image and --vgg; give both.")
    if not 1 <= options.patches <= 64:
        raise UsageError(f"--patches is {options.patches}; 1 to 64 are wanted.")


def views_and_size(options: Options) -> tuple[int, int]:
    """How many views are painted, and the pixels of their longer side."""
    features = bool(options.vgg or options.clip_model)  # whose gradients take most of the time
    views = (24 if features else 48) if options.views is None else options.views
    return views, (256 if features else 384) if options.size is None else options.size


def with_named_style(options: Options) -> Options:
    """Words without a model that reads them: the shape or the picture of ours that they name.

    Raises BadFile where they name none, UsageError where a shape was given beside one.
    """
    from shapeshift.app.terminal import say
    from shapeshift.training.style_features.named_styles import find_style

    if not options.text or options.clip_model:
        return options
    found = find_style(options.text)
    if found.kind == "shape" and options.shape:
        raise UsageError(
            f"--text '{options.text[:40]}' is the shape {found.name}, and --shape is "
            f"{options.shape}; leave one of them out."
        )
    if found.kind == "shape" and options.vgg:
        raise UsageError(
            f"--text '{options.text[:40]}' is the shape {found.name}; leave out --vgg."
        )
    if found.kind == "picture" and not options.vgg:
        raise UsageError(
            f"--text '{options.text[:40]}' is the picture {found.name}; give --vgg, an ONNX file "
            "of VGG16, or --clip-model."
        )
    say(f"'{options.text[:60]}' is the {found.kind} {found.name} of this program.")
    if found.kind == "shape":
        return replace(options, text="", shape=cast(Shape, found.name))
    return replace(options, text="", image=Path(found.name))


def style_picture(path: Path) -> "np.ndarray":
    """(H, W, 3) float32 of a file, or of a picture of our own by its name.  Raises BadFile."""
    from shapeshift.training.style_features.named_styles import MADE_STYLES
    from shapeshift.training.styles.carried_pictures import LEAST_PX, read_picture
    from shapeshift.training.styles.image_network import resized

    if not path.exists() and path.name in MADE_STYLES:  # the program makes paths absolute
        return MADE_STYLES[path.name](MADE_SIDE, 0)
    picture = read_picture(path)
    factor = LONGEST_SIDE / max(picture.shape[:2])
    if factor >= 1:
        return picture
    width, height = (max(round(side * factor), LEAST_PX) for side in picture.shape[1::-1])
    return resized(picture, (width, height))


def looks_of(options: Options) -> "StylePictures | None":
    """Who paints the stop by features of VGG16 or CLIP; None where nothing asks for that.

    Raises BadFile.
    """
    if options.quality == "preview" or not (options.vgg or options.clip_model):
        return None
    if options.clip_model is None:
        from shapeshift.training.style_features.nnfm_pictures import nnfm_pictures

        assert options.vgg is not None and options.image is not None, "checked before"
        return nnfm_pictures(options.vgg, [style_picture(options.image)], seed=options.seed)
    from shapeshift.training.style_features.clip_model import ClipModel
    from shapeshift.training.style_features.clip_pictures import (
        PatchSettings,
        clip_pictures,
        picture_direction,
        text_direction,
    )

    clip = ClipModel(options.clip_model)
    if options.image is not None:
        towards = picture_direction(clip, style_picture(options.image))
    else:
        towards = text_direction(clip, options.text)
    return clip_pictures(clip, towards, PatchSettings(options.patches), options.seed)


def read_cameras(options: Options, path: Path):
    """The CameraList of a file.  Raises BadFile, and UsageError for too many."""
    from shapeshift.app.camera_files import camera_reading
    from shapeshift.app.terminal import say
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    cameras = read_camera_list(path, camera_reading(options))
    for note in cameras.notes:
        say(note)
    if len(cameras.views) > 500:
        raise UsageError(f"--cameras {path} holds {len(cameras.views)} cameras, at most 500 fit.")
    return cameras


def preview_of(
    options: Options,
    device,
    model: "AnchorModel",
    source: str,
    progress: Callable[[str, float], None] | None,
) -> "Rule":
    """The colours of --image without training, as a rule for splats.  Raises BadFile."""
    from shapeshift.scene.cameras.framing import default_background
    from shapeshift.training.style_features.splat_features import (
        VIEW_SIZE,
        StylePreview,
        recolor_rule,
        scene_views,
    )
    from shapeshift.training.styles.add_style import BEHIND
    from shapeshift.training.styles.train_stop import resized_views

    assert options.vgg is not None and options.image is not None, "checked before"
    picture = style_picture(options.image)
    views = scene_views(model)
    if options.cameras is not None:
        views = resized_views(read_cameras(options, options.cameras).views, VIEW_SIZE[0])
    behind = default_background(model, BEHIND)
    preview = StylePreview(device, model, source, options.vgg, views, behind, progress)
    return recolor_rule(preview.colors(picture, seed=options.seed))
