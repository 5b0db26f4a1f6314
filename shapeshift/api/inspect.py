"""What a scene measures: degrees, depths, marks, lengths; from its values, never from colours."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, get_origin, get_type_hints

import numpy as np

from shapeshift.api.arguments import Camera, PathText, Progress, Size
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python
from shapeshift.api.render import shared_renderer
from shapeshift.api.views import choose_views
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import (
    MeasuredScene,
    ValueChoice,
    depth_picture,
    draw_values,
    measured_scene,
    value_facing,
)
from shapeshift.app.inspection.measure_outputs import (
    check_reports,
    keep_file,
    kept_lengths,
    picture_of,
    with_lengths_of,
    write_length_reports,
)
from shapeshift.app.inspection.thermal import USUAL_SIZE, Inspection
from shapeshift.app.paths import plain
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.stop_weights import control_text
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.lengths import Measurement, Point, Scale
from shapeshift.scene.inspection.lengths import measure as measured_length
from shapeshift.scene.inspection.marks import Mark, MarkReading, read_mark
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    kept_scale,
    marks_path,
    moved_marks,
    read_marks_file,
)
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

BLACK = (0.0, 0.0, 0.0)
AirNumbers = Sequence[float]  # metres, per cent of humidity, °C
# (column, row) in pixels of a view, or (x, y, z) metres in the world.
Place = Sequence[float] | np.ndarray


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
        file: MarksFile | None = None
        if marks is None and self.path is None:
            raise UsageError("this scene lies in no file, so no marks lie beside it; give them.")
        if marks is None or not isinstance(marks, Iterable) or isinstance(marks, str):
            if marks is None:
                assert self.path is not None, "refused above"
                path = marks_path(self.path)
            else:
                path = plain(marks)
            file = moved_marks(read_marks_file(path), -self.origin)
            marks = file.marks
        marks = tuple(marks)
        picture = self.values(camera, size, **choice)  # type: ignore[arg-type]  # as above
        kept = replace(file or MarksFile(), marks=marks)
        if picture.emission is not None:  # what the call says stands above the file
            kept = replace(kept, emission=picture.emission)
        picture = kept.of_surfaces(picture)
        return tuple(read_mark(mark, picture) for mark in marks)

    def thermal(
        self,
        camera: Camera = "front",
        size: Size | None = None,
        *,
        out: PathText | None = None,
        csv: PathText | None = None,
        report: Sequence[PathText] = (),
        marks: PathText | None = None,
        capture: PathText | None = None,
        save: bool = False,
        overwrite: bool = False,
        progress: Progress | None = None,
        **how: Any,
    ) -> Inspection:
        """What `shapeshift thermal` measures and writes (docs/thermal.md): `views`, each with its
        readings, differences and isotherms, `file`, the marks in metres of this scene, `scale`.

        out: a .png of photo, heat and alarms.  csv: a table of all readings.  report: .html, .pdf.
        marks: a file of them, None: NAME.marks.json beside the scene; save keeps new ones there.
        capture: photos whose held-out ones give the error.  how: the command's other options:
        spot, box, circle, line (texts or sequences of them), difference, above, below, between,
        emissivity, reflected, air, level, span, auto, palette, stop, range, unit, view, title ...
        progress: called with (what, part 0..1).  Raises UsageError, BadFile.

            found = scene.thermal(spot="mid=240,180", above=60.0, out="alarms.png")
            print(found.views[0].readings[0].mean, found.views[0].isotherms[0].share)
        """
        size = USUAL_SIZE if size is None and camera == "front" else size
        files = {"out": out, "csv": csv, "marks": marks, "capture": capture}
        how |= {name: plain(path) for name, path in files.items() if path is not None}
        how |= {"report": tuple(map(plain, report)), "save": save, "overwrite": overwrite}
        views = choose_views(self, camera, 1, size)
        with in_words_of_python():
            return _inspection(self, views, how, progress or silent)

    def measure(
        self,
        kind: str,
        *places: Place,
        camera: Camera = "front",
        size: Size | None = None,
        known: tuple[Place, Place, float] | None = None,
        keep: bool = False,
        report: Sequence[PathText] = (),
        overwrite: bool = False,
    ) -> Measurement:
        """A distance, polyline, angle or area between places, with its uncertainty.

        places: (column, row) of a view, on the surface at the scene's x, or (x, y, z) metres in the
        world, which count as exact.  known: two places and the metres between them, from which the
        scale comes; None: the scale that NAME.marks.json beside the scene has, if it has one.
        keep: in that file, scale and length.  report: .html, .pdf of the view with all lengths.
        Raises UsageError, BadFile.

            wide = scene.measure("distance", (120, 200), (420, 210))
            print(wide.value, wide.uncertainty, wide.unit)
        """
        paths = tuple(map(plain, report))
        if (keep or paths) and self.path is None:
            raise UsageError("this scene lies in no file, so no lengths lie beside it.")
        with in_words_of_python():
            check_reports(paths, overwrite)
        picture = self._depths(camera, size)
        try:
            scale = kept_scale(self.path) if self.path is not None else Scale()
            if known is not None:
                scale = Scale.of_known([_point(picture, p) for p in known[:2]], float(known[2]))
            points = [_point(picture, place) for place in places]
            found = measured_length(kind, points, scale)
        except ValueError as error:
            raise UsageError(str(error)) from None
        if self.path is not None and (keep or paths):
            file = with_lengths_of(kept_lengths(self.path, self.origin), [(kind, points)], scale)
            view = choose_views(self, camera, 1, size)[0]
            if paths:
                with shared_renderer("auto", "auto", RenderSettings(), BLACK) as renderer:
                    drawn = renderer.inspect(lambda frames: picture_of(frames, self.subject, view))
                x = "" if self.x is None else control_text(self.x)
                how = (self.path, drawn, view, file, "m", self.origin, x)
                write_length_reports(paths, *how, silent)
            if keep:
                with in_words_of_python():
                    keep_file(self.path, file, self.origin, silent)
        return found

    def _depths(self, camera: Camera, size: Size | None) -> ValuePicture:
        view = choose_views(self, camera, 1, size)[0]
        with shared_renderer("auto", "auto", RenderSettings(), BLACK) as renderer:
            return renderer.inspect(lambda frames: depth_picture(frames, self.drawn, view))


def _inspection(
    scene: OpenedScene, views: list[View], how: dict[str, Any], progress: Progress
) -> Inspection:
    """What `thermal` of a scene gives; how: options of the command."""
    from shapeshift.app.inspection.mark_options import open_marks
    from shapeshift.app.inspection.thermal import (
        OF_OPENING,
        Options,
        check_outputs,
        inspect,
        picked,
        subject_of,
        write_all,
    )
    from shapeshift.scene.captures.read_capture import read_capture

    known = {each.name for each in fields(Options)} - OF_OPENING
    for name in how:
        if name not in known:
            raise UsageError(f"there is no option '{name}'; there are {', '.join(sorted(known))}.")
    alone = {n for n, word in get_type_hints(Options).items() if get_origin(word) is tuple}
    several = {
        name: (word,) if isinstance(word, str | int) else tuple(word)
        for name, word in how.items()
        if name in alone
    }
    if how.get("taken_as") is not None:
        how = how | {"taken_as": plain(how["taken_as"])}
    given: dict[str, Any] = how | several
    options = Options(scene.path or plain("scene"), **given)
    check_outputs(options)
    if scene.path is None and options.marks is None and options.save:
        raise UsageError("this scene lies in no file; name a file of marks: marks=.")
    at_all = scene.path is not None or options.marks is not None
    path, file = open_marks(options) if at_all else (options.scene, MarksFile())
    subject = subject_of(options, file, scene.subject)
    photos = None if options.capture is None else read_capture(options.capture)

    def one_by_one(work: Collection, what: str) -> Iterator[Any]:
        for number, each in enumerate(work):
            progress(what, number / len(work))
            yield each

    with shared_renderer("auto", "auto", RenderSettings(), BLACK) as renderer:
        seen = picked(options, views)
        found = renderer.inspect(
            lambda frames: inspect(frames, options, subject, seen, photos, one_by_one)
        )
    write_all(options, found, path, scene.subject, silent)
    return found


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


def silent(*said: object) -> None:
    """Nobody listens."""
