"""What a setting costs in the picture: the present view drawn exactly and as set, once, at rest."""

from dataclasses import dataclass, fields, replace

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View

REST_S = 0.4  # so long nothing must move before two frames are spent on a comparison
MOST_DB = 200.0  # for pictures that are equal
NO_SHORTCUTS = ("background", "debug", "heat_ends")  # fields that cost neither time nor likeness


def exact(settings: RenderSettings, drawing: str) -> RenderSettings:
    """The setting that leaves nothing out, over the same background and in the same
    colours of heat.

    `drawing` is what the renderer draws with: quads blend into float32 then, tiles always do.
    """
    target = "rgba32f" if drawing.startswith("quads") else settings.target
    return RenderSettings(
        background=settings.background, target=target, heat_ends=settings.heat_ends
    )


def is_exact(settings: RenderSettings, drawing: str) -> bool:
    """Whether a picture at these settings is the exact one, debug view aside."""
    return replace(settings, debug="") == exact(settings, drawing)


def shortcuts(settings: RenderSettings) -> list[str]:
    """Names of the fields that are not as in the exact setting."""
    plain = RenderSettings()
    names = [field.name for field in fields(plain) if field.name not in NO_SHORTCUTS]
    return [name for name in names if getattr(settings, name) != getattr(plain, name)]


def measure_error(renderer: Renderer, view: View, settings: RenderSettings) -> float:
    """PSNR in dB of the picture at `settings` against the exact one, both drawn now.

    The renderer is left with the picture at `settings`, and with those settings.
    """
    settings = replace(settings, debug="")
    renderer.settings = exact(settings, renderer.backends["drawing"])
    renderer.draw([view])
    reference = renderer.resolved(0)
    renderer.settings = settings
    renderer.draw([view])
    return min(psnr(reference, renderer.resolved(0)), MOST_DB)


@dataclass
class Comparison:
    """When to compare: once for each picture, after it has rested for a moment.

    `key` is what a picture is drawn from, its scene first: `same_picture` says which are equal.
    """

    db: float | None = None
    _key: tuple | None = None  # of what `db` was measured for
    _seen: tuple | None = None  # of what was shown last, and since when
    _since: float = 0.0

    def due(self, key: tuple, now: float, moving: bool) -> bool:
        """Whether `key`, shown at rest for REST_S now, has not been measured yet."""
        if moving or not same_picture(self._seen, key):
            self._seen, self._since = key, now
        return self.is_old(key) and now - self._since >= REST_S

    def measured(self, key: tuple, db: float) -> None:
        self._key, self.db = key, db

    def is_old(self, key: tuple) -> bool:
        return not same_picture(self._key, key)


def same_picture(one: tuple | None, other: tuple) -> bool:
    """Scenes are compared by identity: they are replaced, never changed."""
    return one is not None and one[0] is other[0] and one[1:] == other[1:]
