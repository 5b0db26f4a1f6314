"""What a scene measures: degrees, depths, marks, lengths; from its values, never from colours."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.api.arguments import Camera, PathText, Progress, Size
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import opened
from shapeshift.api.render import Context, Drawing, shared_renderer
from shapeshift.api.views import choose_views
from shapeshift.app.change.find_change import ChangeChoice, SceneChange
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import (
    MeasuredScene,
    ValueChoice,
    depth_picture,
    draw_values,
    measured_scene,
)
from shapeshift.app.inspection.facing import value_facing
from shapeshift.app.paths import plain
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.lengths import Measurement, Point, Scale
from shapeshift.scene.inspection.lengths import measure as measured_length
from shapeshift.scene.inspection.marks import Mark, MarkReading, read_mark
from shapeshift.scene.inspection.marks_file import (
    kept_scale,
    marks_path,
    moved_marks,
    read_marks_file,
)
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer as FrameRenderer

BLACK = (0.0, 0.0, 0.0)
AirNumbers = Sequence[float]  # metres, per cent of humidity, °C
Place = Sequence[float]  # (column, row) in pixels of a view, or (x, y, z) metres in the world


class InspectedScene(OpenedScene):
    """What a `Scene` measures of itself."""

    def values(
        self,
        camera: Camera = "front",
        size: Size | None = None,
        *,
        stop: str = "",
        value_range: tuple[float, float] | None = None,
        unit: str = "",
        colors: str = "",
        emissivity: float | None = None,
        reflected: float | None = None,
        air: AirNumbers | None = None,
    ) -> ValuePicture:
        """A view of the value stop as numbers: `values` (H, W) in `unit` and `depth_m` (H, W),
        NaN where less than half of a pixel is covered, and `points` (H, W, 3) metres in the world.

        stop: which one; "": the first thermal one.  value_range, unit: what its black and white
        stand for, where the scene does not say.  colors: the palette of a stop that holds its
        colours and no values.  emissivity, reflected: of the surfaces that are seen, whose
        temperatures the values become; None: 1, and 20 in their unit.  air: metres, per cent of
        humidity and °C of what lay between camera and surface; None: nothing.  None of the three:
        values are as photographed.  Raises UsageError.

            seen = scene.values("front", (640, 480))
            (column, row), celsius = seen.hottest()
        """
        measured = measured_scene(self.subject, ValueChoice(stop, value_range, unit, colors))
        picture = _drawn(measured, choose_views(self, camera, 1, size)[0])
        return _corrected(picture, emissivity, reflected, air)

    def temperature(
        self,
        place: Place,
        camera: Camera | None = None,
        size: Size | None = None,
        emissivity: float | None = None,
        reflected: float | None = None,
        air: AirNumbers | None = None,
        **choice: "str | tuple[float, float]",
    ) -> float:
        """The value of the value stop, in its unit, at (x, y, z) metres in the world or at
        (column, row) of a view; NaN where nothing is seen.

        camera None: a place in the world is read in the view, of 32 around it, that its surface
        faces most; a pixel in the front view.  emissivity and all that follows: as of `values`.
        Raises UsageError.

            celsius = scene.temperature((0.31, 0.22, 0.05))
        """
        spot = _numbers(place)
        chosen = ValueChoice(**choice)  # type: ignore[arg-type]  # names and types of `values`
        measured = measured_scene(self.subject, chosen)
        if len(spot) == 3 and camera is None:
            radius = self.bounds[1]

            def seen(view: View) -> ValuePicture:
                return _corrected(_drawn(measured, view), emissivity, reflected, air)

            return value_facing(seen, spot, radius)
        picture = _drawn(measured, choose_views(self, camera or "front", 1, size)[0])
        picture = _corrected(picture, emissivity, reflected, air)
        if len(spot) == 3:
            return float(picture.values_at(spot[None])[0])
        return float(picture.at(picture.values, spot[None])[0])

    def depth(self, pixel: Place, camera: Camera = "front", size: Size | None = None) -> float:
        """Metres along the view at (column, row), at the scene's x; NaN where nothing is.

        metres = scene.depth((320, 180))
        """
        picture = self._depths(camera, size)
        return float(picture.at(picture.depth_m, _numbers(pixel)[None])[0])

    def read_marks(
        self,
        marks: "Iterable[Mark] | PathText | None" = None,
        camera: Camera = "front",
        size: Size | None = None,
        **choice: "str | tuple[float, float]",
    ) -> tuple[MarkReading, ...]:
        """What a view reads at marks: name, least, mean, most, samples, profile; NaN: not seen.

        marks: some, a file of them, or None: the file that lies beside the scene, NAME.marks.json.
        choice: as of `values`.  Raises UsageError, BadFile.

            for reading in scene.read_marks(): print(reading.mark.name, reading.mean)
        """
        emission: Emission | None = None
        if marks is None and self.path is None:
            raise UsageError("this scene lies in no file, so no marks lie beside it; give them.")
        if marks is None or not isinstance(marks, Iterable) or isinstance(marks, str):
            if marks is None:
                assert self.path is not None, "refused above"
                path = marks_path(self.path)
            else:
                path = plain(marks)
            file = moved_marks(read_marks_file(path), -self.origin)
            marks, emission = file.marks, file.emission
        picture = self.values(camera, size, **choice)  # type: ignore[arg-type]  # as above
        if emission is not None and picture.emission is None and picture.is_temperature:
            picture = picture.corrected(emission)
        return tuple(read_mark(mark, picture) for mark in marks)

    def measure(
        self,
        kind: str,
        *places: Place,
        camera: Camera = "front",
        size: Size | None = None,
        known: tuple[Place, Place, float] | None = None,
    ) -> Measurement:
        """A distance, polyline, angle or area between places, with its uncertainty.

        places: (column, row) of a view, on the surface at the scene's x, or (x, y, z) metres in the
        world, which count as exact.  known: two places and the metres between them, from which the
        scale comes; None: the scale that NAME.marks.json beside the scene has, if it has one.
        Raises UsageError, BadFile.

            wide = scene.measure("distance", (120, 200), (420, 210))
            print(wide.value, wide.uncertainty, wide.unit)
        """
        picture = self._depths(camera, size)
        try:
            scale = kept_scale(self.path) if self.path is not None else Scale()
            if known is not None:
                scale = Scale.of_known([_point(picture, p) for p in known[:2]], float(known[2]))
            return measured_length(kind, [_point(picture, place) for place in places], scale)
        except ValueError as error:
            raise UsageError(str(error)) from None

    def _depths(self, camera: Camera, size: Size | None) -> ValuePicture:
        view = choose_views(self, camera, 1, size)[0]
        with shared_renderer("auto", "auto", RenderSettings(), BLACK) as renderer:
            return renderer.inspect(lambda frames: depth_picture(frames, self.drawn, view))


def _drawn(measured: MeasuredScene, view: View) -> ValuePicture:
    with shared_renderer("auto", "auto", RenderSettings(), BLACK) as renderer:
        return renderer.inspect(lambda frames: draw_values(frames, measured, view))


def _corrected(
    picture: ValuePicture, emissivity: float | None, reflected: float | None, air: AirNumbers | None
) -> ValuePicture:
    """Raises UsageError."""
    if emissivity is None and reflected is None and air is None:
        return picture
    given = {"emissivity": emissivity, "reflected": reflected}
    try:
        surface = SurfaceRadiation(**{k: float(v) for k, v in given.items() if v is not None})
        between = Air() if air is None else Air(*map(float, air))
        return picture.corrected(Emission(surface, air=between))
    except ValueError as error:
        raise UsageError(str(error)) from None


def _numbers(place: Place) -> np.ndarray:
    """(2,) or (3,) float64.  Raises UsageError."""
    numbers = np.array(place, np.float64)
    if numbers.shape not in ((2,), (3,)) or not np.isfinite(numbers).all():
        raise UsageError(f"a place is {place}; (column, row) or (x, y, z) is wanted.")
    return numbers


def _point(picture: ValuePicture, place: Place) -> Point:
    numbers = _numbers(place)
    if len(numbers) == 3:
        return Point(numbers, np.zeros((3, 3)))
    return picture.picked((numbers[0], numbers[1]))


def silent(what: str, part: float) -> None:
    """Nobody listens."""


def change(
    before: PathText | OpenedScene,
    after: PathText | OpenedScene,
    *,
    degrees: float | None = None,
    millimetres: float = 0.0,
    stop: str = "",
    values: str = "",
    value_range: tuple[float, float] | None = None,
    cameras: Camera | None = None,
    size: Size = (320, 240),
    out: PathText | None = None,
    overwrite: bool = False,
    drawing: Drawing = "auto",
    context: Context = "auto",
    progress: Progress | None = None,
) -> SceneChange:
    """Where an earlier and a later scene of one place differ: `places`, the largest first, each
    with its kind (moved, appeared, vanished, hotter, colder, recoloured), centre and box in metres
    of `before`, area_m2, amount and unit; and `registration`, how their worlds fit together.

    degrees, millimetres: from where on values and shapes count; None is 5 of heat, of others a
    twentieth of their range; 0 mm is a thirty-second of the
    scene's radius.  stop: whose colours and shapes are compared; "": the first that shows no
    values.  values: the stop whose values are; "": the first thermal one, else the first of others.
    value_range: of such stops that do not say it.  cameras: views of `before`; None is all
    around.  out: a folder, as the command writes it.  Raises UsageError, BadFile where the scenes
    do not fit together.

        for place in ss.change("march.shift", "june.shift").places:
            print(place.kind, place.centre, place.amount, place.unit)
    """
    from shapeshift.api.views import choose_views
    from shapeshift.app.change.draw_pairs import visit_of
    from shapeshift.app.change.find_change import find_change
    from shapeshift.app.change.outputs import check_folder, write_change

    choice = ChangeChoice(0.0, millimetres / 1000, degrees, size=size)
    choice.settings(1.0)  # refused before anything is read
    folder = None if out is None else plain(out)
    if folder is not None:
        check_folder(folder, overwrite)
    scenes = opened(before), opened(after)
    names = (scenes[0].path or plain("before")).name, (scenes[1].path or plain("after")).name
    visits = (
        visit_of(scenes[0].subject, names[0], stop, value_range, values),
        visit_of(scenes[1].subject, names[1], stop, value_range, values),
    )
    views = None if cameras is None else choose_views(scenes[0], cameras, 1, size)

    def work(frames: "FrameRenderer") -> SceneChange:
        found = find_change(frames, visits, names, choice, views, progress or silent)
        if folder is not None:
            write_change(frames, found, names, folder, progress or silent)
        return found.change

    with shared_renderer(drawing, context, RenderSettings(), BLACK) as renderer:
        return renderer.inspect(work)
