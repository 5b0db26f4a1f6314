"""Emissivity as `thermal` is told of it: of all that is seen, of single marks and objects."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol, TypeVar

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import (
    Emission,
    SurfaceRadiation,
    camera_settings,
    scale_of,
)
from shapeshift.scene.inspection.marks_file import MarksFile

Made = TypeVar("Made")


class EmissionOptions(Protocol):
    """Those of a command's options that are read here."""

    @property
    def emissivity(self) -> tuple[str, ...]: ...
    @property
    def reflected(self) -> float | None: ...
    @property
    def taken_with(self) -> tuple[float, float] | None: ...
    @property
    def air(self) -> tuple[float, float, float] | None: ...
    @property
    def taken_air(self) -> tuple[float, float, float] | None: ...
    @property
    def taken_as(self) -> Path | None: ...


def choose_emission(
    options: EmissionOptions, file: MarksFile, unit: str
) -> tuple[Emission | None, dict[str, float]]:
    """What corrects values of this unit, None: nothing does; and emissivities by mark.

    Raises UsageError, one sentence.
    """
    own = {}
    of_all: float | None = None
    for text in options.emissivity:
        name, equals, number = text.rpartition("=")
        try:
            share = SurfaceRadiation(float(number)).emissivity
        except ValueError as error:
            raise UsageError(f"--emissivity is '{text}': {_why(number, error)}") from None
        if equals:
            own[name.strip()] = share
        elif of_all is not None:
            raise UsageError(f"--emissivity has {of_all:g} and {share:g} for all; one is wanted.")
        else:
            of_all = share
    marked = own or file.objects or any(mark.emissivity is not None for mark in file.marks)
    before = file.emission
    given = (
        of_all, options.reflected, options.taken_with, options.air, options.taken_air,
        options.taken_as,
    )  # fmt: skip
    if not (before or marked or any(each is not None for each in given)):
        return None, own
    camera = _camera(options, unit)
    try:
        scale_of(unit)
    except ValueError as error:
        raise UsageError(str(error)) from None
    known = before or as_set(camera)
    share = known.surface.emissivity if of_all is None else of_all
    mirrored = known.surface.reflected if options.reflected is None else options.reflected
    surface = _made("--reflected", SurfaceRadiation, share, mirrored)
    taken, camera_air = camera or (known.taken, known.taken_air)
    if options.taken_with:
        taken = _made("--taken-with", SurfaceRadiation, *options.taken_with)
    air = _made("--air", Air, *options.air) if options.air else known.air
    if options.taken_air:
        camera_air = _made("--taken-air", Air, *options.taken_air)
    return Emission(surface, taken, air, camera_air), own


def _made(option: str, kind: Callable[..., Made], *numbers: float) -> Made:
    """What an option's numbers stand for.  Raises UsageError, one sentence."""
    try:
        return kind(*numbers)
    except ValueError as error:
        raise UsageError(f"{option}: {error}") from None


def _camera(options: EmissionOptions, unit: str) -> tuple[SurfaceRadiation, Air] | None:
    """What the camera of a radiometric photo was set to.  Raises UsageError, one sentence."""
    if options.taken_as is None:
        return None
    if unit not in ("°C", "C"):
        raise UsageError(
            f"--taken-as is of values in °C, as radiometric photos have them; the stop's are in "
            f"'{unit}': give --taken-with and --taken-air."
        )
    try:
        return camera_settings(options.taken_as)
    except BadFile as refused:
        raise UsageError(f"--taken-as: {refused}") from None


def as_set(camera: tuple[SurfaceRadiation, Air] | None) -> Emission:
    """What changes no value: surfaces and air as the camera was set to."""
    if camera is None:
        return Emission()
    surface, air = camera
    return Emission(surface, surface, air, air)


def with_emissivities(
    file: MarksFile, own: dict[str, float], objects: Sequence[str] = (), left_out: Collection = ()
) -> MarksFile:
    """The file with these emissivities of marks, else of the scene's objects, by name.

    left_out: names of marks that could not be laid.  Raises UsageError: nothing is called so.
    """
    names = [mark.name for mark in file.marks]
    for name in own:
        if name not in (*names, *objects, *left_out):
            known = ", ".join(dict.fromkeys((*names, *objects))) or "none"
            raise UsageError(
                f"--emissivity: no mark and no object is called '{name}'; there are {known}."
            )
    marks = (replace(m, emissivity=own.get(m.name, m.emissivity)) for m in file.marks)
    of_objects = {n: share for n, share in own.items() if n in objects and n not in names}
    kept = tuple((dict(file.objects) | of_objects).items())
    return replace(file, marks=tuple(marks), objects=kept)


def _why(number: str, error: ValueError) -> str:
    """The sentence of a number that is none, or too small or large."""
    try:
        float(number)
    except ValueError:
        return "a number from 0.1 to 1 is wanted, or NAME=NUMBER for one mark."
    return str(error)
