"""What a new stop is learned from, as the options of `style` say it."""

import math
from typing import TYPE_CHECKING

from shapeshift.app.errors import UsageError
from shapeshift.app.training.style_looks import looks_of, read_cameras, views_and_size
from shapeshift.app.training.style_options import Options
from shapeshift.runtime_models.model import AnchorModel

if TYPE_CHECKING:
    from shapeshift.scene.pose import View
    from shapeshift.training.styles.style_pictures import StylePictures

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
    from shapeshift.training.styles.carried_pictures import CarriedPictures
    from shapeshift.training.styles.picture_files import PictureFiles, files_for
    from shapeshift.training.styles.style_views import dome_views, resized_views

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
    from shapeshift.training.styles.image_network import ImageNetwork, encode_style
    from shapeshift.training.styles.picture_files import read_picture

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
