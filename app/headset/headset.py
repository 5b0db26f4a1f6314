"""launch.py vr: a scene in a headset; without one a sentence, and the viewer where it can open."""

import signal
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, fields
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, Opt
from shapeshift.app.interrupts import ENDINGS, answered, leave_terminal
from shapeshift.app.opening import DrawingOptions
from shapeshift.app.paths import TOUCH
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.editor.state.editor_state import EditorState
    from shapeshift.app.headset.scene_shelf import SceneShelf
    from shapeshift.app.headset.session.headset_link import HeadsetLink
    from shapeshift.app.headset.session.recorder import Shutter
    from shapeshift.app.headset.worn_settings import KeptSettings, Wearing

NO_HEADSET = 4  # exit code
MOST_WAIT_S = 3600.0  # for a runtime that went away


@dataclass(frozen=True)
class Options(DrawingOptions):
    """Walk into a scene and touch it, see docs/vr.md."""

    scene: Annotated[Path | None, POSITIONAL] = None
    """A scene file, a package or splats.  Default: the demo."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands at the start: a stop by its name, or a number from 0 to 1.  Default:
    the first stop, and in a scene file what it says for each object."""
    quality: Literal["auto", "best", "balanced", "fast"] = "auto"
    """auto: shortcuts only where the exact picture of both eyes takes longer than the headset's
    frames last, and fewer pixels while frames are late; best: exact, always."""
    foveation: Literal["off", "low", "medium", "high", "quad"] | None = None
    """Draw all pixels only within 35 (low), 25 or 15 degrees of what is looked at, or of straight
    on, and a quarter of them beyond; quad: the runtime's quad views, a wide one and a sharp inset
    for each eye, and where it offers none as medium.  Default: as the panel was set last, at first
    off."""
    posture: Literal["standing", "seated"] | None = None
    """seated: the room is raised so that your eyes are 1.6 m over its floor; Recentre measures
    anew.  Default: as the panel was set last, at first standing."""
    hands: Literal["both", "left", "right"] | None = None
    """left, right: everything with that controller alone.  Default: as set last, at first both."""
    turning: Literal["snap", "smooth", "none"] | None = None
    """What the stick that does not walk does: turn by 30 degrees at a time, turn evenly, or
    nothing, so that one turns with the body alone.  Default: as set last, at first snap."""
    walking_hand: Literal["left", "right"] | None = None
    """The hand whose stick walks; the other turns and flies.  Default: as set last, at first
    left."""
    panel_hand: Literal["left", "right"] | None = None
    """The hand that carries the panel; the other points at it.  Default: as set last, at first
    left."""
    hand_model: Literal["gloves", "controllers"] | None = None
    """How hands that hold controllers are drawn; for the first ten seconds, while their buttons are
    named, as controllers in any case.  Default: as set last, at first gloves."""
    vignette: float | None = None
    """How dark the edge of the picture gets while a stick moves you; 0: not at all, 1: black.
    Default: as set last, at first 0.8."""
    text_size: float | None = None
    """Size of the panel with its text, 0.75 to 2; 1: capitals a degree high at arm's length.
    Default: as set last, at first 1."""
    glass: Annotated[str, Opt(metavar="STOP")] = ""
    """Hold a round glass through which this stop is seen, in the hand that carries the panel.
    Default: none; the panel has one, too."""
    passthrough: bool | None = None
    """Show the room itself behind the scene, and of a scene of objects these alone, where the
    runtime blends pictures by their alpha or shows the room by a layer of its own.  Default: as set
    last, at first not."""
    floor: bool = True
    """Show a faint grid on the floor and a horizon; the panel switches it, too."""
    visibility: Annotated[bool, EXPERT] = True
    """Draw no splats where the headset's lenses show nothing, if its runtime says where that is."""
    hints: bool = True
    """Name the buttons beside the gloves for ten seconds, and say when frames are late."""
    depth: bool = True
    """Hide hands and the panel behind nearer splats, and tell the runtime how deep the picture is,
    so that late frames are moved and not torn; it costs a second, coarser drawing of the splats."""
    panel_layer: Annotated[bool, EXPERT] = True
    """Let the runtime place the panel itself, sharp at any size of the eyes' pictures."""
    controllers: bool = True
    """No: take hands as the headset's cameras see them even where the runtime makes controllers of
    them.  Hands that hold none are taken so always."""
    edges: bool = True
    """Show the edges of the room that is free to walk in where head or hands come near them, and
    where the runtime knows them."""
    obstacles: bool = True
    """Darken the picture where the head goes into what stands in the scene."""
    reopen: Annotated[float, Opt(metavar="SECONDS")] = 10.0
    """Where the runtime goes away, try so long to go on in a new session, with all as it is; 0:
    not at all."""
    mirror: bool = True
    """Show the left eye in a window too, where there is a display."""
    target_ms: Annotated[float | None, EXPERT] = None
    """Milliseconds that a frame may take with --quality auto.  Default: 85 % of the headset's."""
    floor_db: Annotated[float | None, EXPERT] = None
    """PSNR in dB against the exact picture below which --quality auto never goes.  Default: 35."""
    stereo_colors: Annotated[Literal["auto", "each", "shared"], EXPERT] = "auto"
    """each: colours for each eye, always; shared: for the middle between the eyes; auto: as
    --quality has it, which shares them where nobody can tell."""
    eye_part: Annotated[float, EXPERT] = 1.0
    """Share of the width and height of an eye's picture that the runtime recommends."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    pixels: Annotated[str, Opt(expert=True, metavar="FORMAT")] = ""
    """Format of the runtime's pictures, such as SRGB8_ALPHA8 or RGBA16F.  Default: the best."""
    frames: Annotated[int, EXPERT] = 0
    """End after so many frames, for tests and benchmarks; 0: stay until it is ended."""
    record: Path | None = None
    """Folder, new or empty, for what the left eye sees, as numbered PNGs of the whole session; the
    panel's section Scenes begins and ends recordings too.  Default: none."""
    record_rate: float = 10.0
    """Frames a second of a recording, 0.1 to 120."""
    report: Annotated[Path | None, EXPERT] = None
    """File for what the run was like, as JSON, written at its end.  Default: none."""
    lines: Annotated[Path | None, EXPERT] = None
    """File for one line of JSON a frame, written as it happens.  Default: none."""
    pictures: Annotated[Path | None, EXPERT] = None
    """Folder for the pictures of both eyes.  Default: none are written."""
    every: Annotated[int, EXPERT] = 1
    """Write --pictures of every so many frames."""


def run(options: Options) -> int:
    """0 after a session; NO_HEADSET, or the viewer's code, without one."""
    from shapeshift.vr.openxr.instance import Lost, NoHeadset

    check(options)
    try:
        return wear(options)
    except (NoHeadset, Lost) as reason:
        return without_headset(str(reason), options)


def check(options: Options) -> None:
    """UsageError, one sentence, for what makes no sense."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.headset.worn_settings import LEAST_SIZE, MOST_SIZE

    if not 0.1 <= options.eye_part <= 2:
        raise UsageError(f"--eye-part is {options.eye_part:g}, expected 0.1 to 2.")
    for name, value in (("--target-ms", options.target_ms), ("--floor-db", options.floor_db)):
        if value is not None and not 0 < value < inf:
            raise UsageError(f"{name} is {value}, expected a number above 0.")
        if value is not None and options.quality != "auto":
            raise UsageError(f"{name} is for --quality auto; leave one of the two out.")
    if options.vignette is not None and not 0 <= options.vignette <= 1:
        raise UsageError(f"--vignette is {options.vignette:g}, expected 0 to 1.")
    if not 0 <= options.reopen <= MOST_WAIT_S:
        raise UsageError(f"--reopen is {options.reopen:g}, expected 0 to {MOST_WAIT_S:g} seconds.")
    if options.text_size is not None and not LEAST_SIZE <= options.text_size <= MOST_SIZE:
        size = f"{options.text_size:g}, expected {LEAST_SIZE:g} to {MOST_SIZE:g}"
        raise UsageError(f"--text-size is {size}.")
    if not 0.1 <= options.record_rate <= 120:
        raise UsageError(f"--record-rate is {options.record_rate:g}, expected 0.1 to 120.")
    if options.frames < 0:
        raise UsageError(f"--frames is {options.frames}, expected 0 (no end) or more.")
    if options.every < 1:
        raise UsageError(f"--every is {options.every}, expected 1 or more.")
    if options.scene is not None and not options.scene.exists():
        raise UsageError(f"there is no {options.scene}.")
    for path in (options.report, options.lines):
        if path is not None and not path.absolute().parent.is_dir():
            raise UsageError(f"there is no folder {path.parent} for {path.name}.")
        if path is not None and path.resolve() == (options.scene or TOUCH).resolve():
            raise UsageError(f"{path} is the scene; choose another file.")


def wear(options: Options) -> int:
    """The session from its door to its end.  Raises NoHeadset, Lost."""
    from shapeshift.app.cli import has_display
    from shapeshift.app.document import DARK
    from shapeshift.app.drawing import make_folder
    from shapeshift.app.editor.state.user.settings import ProgramSettings
    from shapeshift.app.editor.window.shell import speak_first
    from shapeshift.app.headset.eyes import Eyes
    from shapeshift.app.headset.headset_report import Report
    from shapeshift.app.headset.mirror import open_mirror
    from shapeshift.app.headset.pacing import FLOOR_DB, Pacing
    from shapeshift.app.headset.scene_shelf import open_xr
    from shapeshift.app.headset.session.headset_link import HeadsetLink
    from shapeshift.app.headset.xr_app import XrApp
    from shapeshift.app.paths import config_folder
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.vr.locomotion import Rules
    from shapeshift.vr.openxr.instance import Lost

    worn = worn_settings(options)
    how = (partial(open_session, options, worn), options.reopen, lambda: worn.now.wants_insets)
    with HeadsetLink(*how) as link:
        document, editor = open_xr(options.scene or TOUCH, options, options.x)
        wearing = wearing_of(options, editor)
        speak_first(ProgramSettings.read(config_folder()), editor.messages)
        pacing = Pacing(
            document.background_or(DARK), options.quality, options.floor_db or FLOOR_DB,
            options.target_ms, options.stereo_colors,
        )  # fmt: skip
        if options.pictures:
            make_folder(options.pictures)
        with (
            Report(options.report, options.lines, options.pictures, options.every) as report,
            open_mirror(has_display(), options.mirror) as mirror,
            link.opened_on(mirror.ctx) as session,
            Renderer(mirror.ctx, options.drawing) as renderer,
            Eyes(mirror.ctx, session.sizes) as eyes,
        ):
            renderer.streaming.converges = False  # a frame is late if it waits for its leaves
            rules = Rules(obstacles=options.obstacles)
            say_missing(link, options, worn)
            xr_app = XrApp(
                session, renderer, eyes, mirror, document, editor, pacing, report, rules, wearing,
                worn, shelf_of(options), shutter_of(options), journals_of(options),
            )  # fmt: skip
            try:
                with interrupting(xr_app), closing(xr_app):
                    report.ended = link.stay(xr_app, options.frames) or report.ended
            except Lost:
                report.ended = "runtime lost"
                raise
            finally:
                report.write(describe(link) | xr_app.state.pacing.report())
    return 0


def say_missing(link: "HeadsetLink", options: Options, worn: "KeptSettings") -> None:
    """What was asked for and the runtime does not have."""
    name, session = link.instance.runtime, link.session
    if not (options.controllers or session.bare_hands.there):
        say(f"{name} sees no hands; controllers are taken.")
    if options.passthrough and not session.sees_through:
        say(f"{name} shows no room behind pictures; the scene has its own.")
    if worn.now.wants_insets and not session.shown.has_insets:
        level = worn.now.sharp(has_insets=False)
        say(f"{name} offers no quad views, one view an eye; --foveation {level} is used instead.")
    for profile in session.hands.refused:
        say(f"{name} does not know {profile}.")


def wearing_of(options: Options, editor: "EditorState") -> "Wearing":
    """What was chosen at the door.  Raises UsageError for a stop that nothing has."""
    from shapeshift.app.headset.over.glass_state import stop_named
    from shapeshift.app.headset.worn_settings import Wearing

    return Wearing(
        options.floor, options.hints, options.depth, options.panel_layer, options.edges,
        options.visibility, stop_named(editor, options.glass),
    )  # fmt: skip


def worn_settings(options: Options) -> "KeptSettings":
    """What the panel kept, and what the options say instead for this session."""
    from shapeshift.app.headset.worn_settings import KeptSettings, WornSettings
    from shapeshift.app.paths import config_folder

    said = {each.name: getattr(options, each.name) for each in fields(WornSettings)}
    return KeptSettings(config_folder(), **said)


def shutter_of(options: Options) -> "Shutter":
    """What takes pictures, and records from the first frame on where that was asked for."""
    from shapeshift.app.headset.session.recorder import Recorder, Shutter
    from shapeshift.app.paths import WorkFolders

    folder = WorkFolders.of().pictures
    recorder = Recorder(folder, options.record_rate)
    if options.record is not None:
        recorder.start(options.record)
    return Shutter(folder, recorder)


def journals_of(options: Options) -> Path | None:
    """Where unsaved work is kept; of a run that is measured none is."""
    from shapeshift.app.paths import data_folder

    measured = bool(options.frames or options.report or options.lines)
    return None if measured else data_folder() / "journals"


def shelf_of(options: Options) -> "SceneShelf":
    """Scenes for the panel; a run that is measured puts none into the list."""
    from shapeshift.app.headset.scene_shelf import SceneShelf
    from shapeshift.app.paths import config_folder

    measured = bool(options.frames or options.report or options.lines)
    return SceneShelf(config_folder(), options, options.scene or TOUCH, keeps=not measured)


def open_session(options: Options, worn: "KeptSettings", instance, ctx):
    """The session that the options and the panel's settings ask for.  Raises NoHeadset, Lost."""
    from shapeshift.vr.openxr.session import Session

    how = (options.eye_part, options.pixels, options.controllers, worn.now.wants_insets)
    return Session(instance, ctx, *how)


@contextmanager
def interrupting(xr_app) -> Iterator[None]:
    """Ctrl-C ends a session as its window's cross does, a second one at once.

    Torn down in the middle of a frame, runtimes and drivers crash.
    """

    def ask(number, stack) -> None:
        leave_terminal(number)
        xr_app.interrupted = True
        restore()

    with answered(ask) as restore:
        if sys.platform != "win32":
            for each in ENDINGS:  # runtimes with a service do not call again
                signal.siginterrupt(each, False)
        yield
    if xr_app.interrupted:
        raise KeyboardInterrupt


def describe(link: "HeadsetLink") -> dict:
    """The report without how it ended, of the last session."""
    instance, session = link.instance, link.session
    return {
        "runtime": instance.runtime,
        "headset": instance.headset,
        "states": session.life.states,
        "reopened": link.reopened,
        "space": session.play.kind,
        "recentrings": session.recentrings,
        "profiles": session.profiles,
        "hand_tracking": session.bare_hands.there,
        "pixels": session.pixels.name,
        "eyes": session.sizes,
        "insets": session.shown.has_insets,
        "depth": session.layers.depth,
        "hidden": session.hidden_parts(),
        "passthrough": session.sees_through,
        "gaze": session.gaze.there,
        **session.pace.report(),
    }


def without_headset(reason: str, options: Options) -> int:
    """Says why, and opens the viewer, unless nobody looks: a measured run, or no display."""
    from shapeshift.app.cli import has_display

    say(f"shapeshift vr: {reason}")
    if options.frames or options.report or not has_display():
        return NO_HEADSET
    from shapeshift.app.editor import desktop

    say("Opening the scene in a window instead.")
    reading = {each.name: getattr(options, each.name) for each in fields(DrawingOptions)}
    return desktop.run(desktop.Options(scenes=(options.scene or TOUCH,), x=options.x, **reading))
