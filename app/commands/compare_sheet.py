"""Pictures of a comparison: the difference, amplified, and A, B and difference side by side."""

import numpy as np

from shapeshift.runtime_models.files.plain_text import one_line

AMPLIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200)
BRIGHT = 0.8  # what the 99.9th percentile of an amplified difference may reach
PERCENTILE = 99.9
NO_DIFFERENCE = (0.5, 0.5, 0.5)  # grey: signed differences lie around it
TEXT, BEHIND = (235, 235, 235), (16, 16, 16)


def amplification(differences: list[np.ndarray]) -> int:
    """The largest of AMPLIFICATIONS at which nearly all differences (H, W, 3) stay visible."""
    largest = max((float(np.percentile(np.abs(d), PERCENTILE)) for d in differences), default=0.0)
    fitting = [a for a in AMPLIFICATIONS if a * largest <= BRIGHT]
    return fitting[-1] if fitting else AMPLIFICATIONS[0]


def difference_picture(a: np.ndarray, b: np.ndarray, amplify: int) -> np.ndarray:
    """(H, W, 3) grey where the two are equal, lighter where b is brighter, by channel."""
    return np.clip(np.array(NO_DIFFERENCE, np.float32) + amplify * (b - a) / 2, 0, 1)


def written(picture: np.ndarray, text: str) -> np.ndarray:
    """The picture with a line in its upper left corner."""
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    image = Image.fromarray((np.clip(np.nan_to_num(picture), 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    height = max(11, image.height // 28)  # pixels of a letter
    font, text = letters(height), drawable(text, height)
    margin = height // 2
    width = draw.textlength(text, font) + 2 * margin
    draw.rectangle((0, 0, width, height + 2 * margin), fill=BEHIND)
    draw.text((margin, margin), one_line(text), fill=TEXT, font=font)
    return np.asarray(image, np.float32) / 255


def scale_text(amplify: int) -> str:
    """What a difference picture's colours mean; 255 steps are black to white."""
    reach = 255 / amplify
    return f"difference x {amplify}  (black -{reach:.3g}, white +{reach:.3g} of 255)"


def sheet(a: np.ndarray, b: np.ndarray, names: tuple[str, str], amplify: int) -> np.ndarray:
    """(H, 3 W, 3) A, B and their difference side by side, each with its name."""
    difference = written(difference_picture(a, b, amplify), scale_text(amplify))
    parts = [written(a, f"A  {names[0]}"), written(b, f"B  {names[1]}"), difference]
    return np.concatenate(parts, axis=1)
