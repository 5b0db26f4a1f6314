"""The world behind the window: colliders of the document's objects, made in a thread, then bodies.

The picture does not wait for it: a scene is there to be seen before it can be touched.  Objects are
touched as rough hulls first, on a rough ground of what is near them, and by their exact pieces, on
the exact one, when those are made.
"""

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.editor.state.files.edited_file import EditedFile, ModelKey, key_of
from shapeshift.app.editor.state.files.opened import Progress
from shapeshift.app.editor.texts.table import said
from shapeshift.app.opening import sentence
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS, SceneFile, SceneItem

if TYPE_CHECKING:
    from shapeshift.scene.colliders.collider import Collider
    from shapeshift.scene.colliders.standing import Plane
    from shapeshift.scene.world.world import World

PATIENCE_S = 3.0  # longest wait at the end for a collider that is being made
HZ = 90  # steps of the physics a second


class Bodies:
    """Colliders by object, and the world once all that are asked for are there."""

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        """Nothing is open yet."""
        self.world: World | None = None  # None: nothing can be touched, or not yet
        self.problem = ""  # one sentence: why something cannot be touched; "" = nothing is wrong
        self.notes: list[str] = []  # what the physics has changed on the way in
        self._of: dict[str, tuple[tuple, Collider]] = {}  # name -> what it was made of, and it
        self._made: dict[tuple, Collider | None] = {}  # of a mesh or model; None: there is none
        self._stands: dict[str, Stood] = {}  # by name: where things stood, and on what
        self._ground: tuple = ()  # floor and gravity of the world
        self._future: Future | None = None
        self.stale = True  # the world does not know of the last edits yet
        self._due = False  # a frame more is wanted
        self._told: set[str] = set()  # notes of this scene
        self.why_none = ""  # the problem that left nothing to be touched; "": none did
        self._given_up = False  # there can be no world: the scene is there to be seen and edited
        self._unwanted = threading.Event()  # ends the thread at its next word
        self._thread: threading.Thread | None = None
        self._making = ("", 0.0)  # what is being done for a collider, part done

    def __enter__(self) -> "Bodies":
        return self

    def __exit__(self, *_: object) -> None:
        """Ends what is being made, the process that cuts it up too."""
        self._unwanted.set()
        if self._thread is not None:
            self._thread.join(PATIENCE_S)

    def forget(self) -> None:
        """Another scene; a collider that is being made is not waited for."""
        self._unwanted.set()
        self._begin()

    @property
    def living(self) -> "World":
        """The world, for who has seen that there is one."""
        if self.world is None:
            raise RuntimeError("nothing can be touched: there is no world.")
        return self.world

    def adopt(self, world: "World", edited: EditedFile) -> None:
        """A world that somebody else has made of the file; it follows its edits from now on."""
        self.forget()
        file, self.world, self.stale = edited.file, world, False
        self._ground = (file.floor_y, file.gravity_m_s2)
        for item in file.all_items:
            made = world.objects[item.name].collider
            if made is not None:
                self._of[item.name] = (made_of(item), made)
            elif item.collider is not None:
                self._made[making_of(item)] = None

    def call_anew(self, names: Mapping[str, str]) -> None:
        """Objects have other names; what was made of them stays theirs."""
        self._of = {names.get(name, name): made for name, made in self._of.items()}

    @property
    def busy(self) -> bool:
        return self._future is not None

    @property
    def pending(self) -> bool:
        """Whether there may be a world soon that is not there yet."""
        return self.world is None and (self.busy or (self.stale and not self._given_up))

    @property
    def status(self) -> str:
        what, part = self._making
        return f"{what} {part:.0%}" if self.busy else ""

    def follow(self, edited: EditedFile) -> None:
        """Lets the world know of an edit, as soon as there are the colliders for it.

        Raises BadFile, with the world as it was, for an object that cannot be as the file says.
        """
        self.stale = True
        self._catch_up(edited)

    def poll(self, edited: EditedFile) -> bool:
        """Once a frame; True while colliders are being made."""
        if self._future is not None and self._future.done():
            future, self._future = self._future, None
            done: Done = future.result()
            self._exchange(done)
            self.problem = done.problem or self.problem
            self.why_none = done.problem or self.why_none
        try:
            self._catch_up(edited)
        except BadFile as error:
            self.problem, self.stale = str(error), False
            self.why_none, self._given_up = self.problem, self.world is None
        return self.busy or self._due

    def _exchange(self, done: "Done") -> None:
        """A collider, in the place of the rough one that stood in for it."""
        self._made[done.key] = done.collider
        for name, (made_of_it, before) in self._of.items():
            if done.rough is not None and before is done.rough and done.collider is not None:
                self._of[name], self.stale = (made_of_it, done.collider), True
        for key, collider in done.pressed.items():
            self._made[key] = collider
        self._stands.update(done.stands)

    def _catch_up(self, edited: EditedFile) -> None:
        self._due = False
        if self.busy or self._given_up:
            return
        file = edited.file
        touched = [item for item in file.all_items if item.collider is not None]
        if self.stale:
            missing = [item for item in touched if not self._is_made(item)]
            missing.sort(key=lambda item: item.name == BACKGROUND)  # small things first
            if missing:
                self._start(edited, missing[0], None)
                return
            self._bring_up_to_date(file, edited, touched)
            self._due = self.world is not None  # exact bodies are begun on in the next frame
            return
        if self.world is not None and not self.stale:
            found = ((item, self._collider(item)) for item in touched)
            rough = [(item, made) for item, made in found if made is not None and made.rough]
            rough.sort(key=lambda pair: pair[0].name == BACKGROUND)
            if rough:
                self._start(edited, *rough[0])

    def _bring_up_to_date(
        self, file: SceneFile, edited: EditedFile, touched: list[SceneItem]
    ) -> None:
        found = {item.name: self._collider(item) for item in touched}
        colliders = {name: made for name, made in found.items() if made is not None}
        if self.world is not None and self.world.holds and self._changes(colliders):
            return  # what a hand holds would be lost to it: when it lets go
        self._of = {i.name: (made_of(i), colliders[i.name]) for i in touched if i.name in colliders}
        if touched or self.world is not None:
            self._to_world(file, edited, colliders)
        self.stale = False

    def _changes(self, colliders: Mapping[str, "Collider"]) -> bool:
        """Whether an object of the world gets its exact pieces now."""
        objects = self.living.objects
        return any(
            before is not None and before.rough and colliders.get(name) is not before
            for name, before in ((name, obj.collider) for name, obj in objects.items())
        )

    def _to_world(
        self, file: SceneFile, edited: EditedFile, colliders: Mapping[str, "Collider"]
    ) -> None:
        from shapeshift.scene.world.follow import follow
        from shapeshift.scene.world.world import World

        models, ground = edited.models_by_name(), (file.floor_y, file.gravity_m_s2)
        if self.world is None or self._ground != ground:  # a floor is no object that comes or goes
            paused = self.world is None or self.world.paused
            self.world, self._ground = World(file, models, colliders, hz=HZ), ground
            self.world.paused = paused
            known = 0
        else:
            known = len(self.world.findings)
            follow(self.world, file, models, colliders)
        told = (sentence(finding) for finding in self.world.findings[known:])
        fresh = [words for words in told if words not in self._told]  # a body may come again
        self._told.update(fresh)
        self.notes += fresh

    def _is_made(self, item: SceneItem) -> bool:
        return self._of_before(item) is not None or making_of(item) in self._made

    def _collider(self, item: SceneItem) -> "Collider | None":
        """What was made for the object or for its like; None: it has none, or none yet."""
        before = self._of_before(item)
        return self._made.get(making_of(item)) if before is None else before

    def _of_before(self, item: SceneItem) -> "Collider | None":
        """What the object has had so far, where that still fits; x may have moved since."""
        made, collider = self._of.get(item.name, (None, None))
        return collider if made == made_of(item) else None

    def _start(self, edited: EditedFile, item: SceneItem, rough: "Collider | None") -> None:
        """Makes one collider in a thread that the program's end does not wait for.

        rough: what it is touched as so far; None: nothing, and a rough one is made.
        """
        future = self._future = Future()
        file, model, unwanted = edited.file, edited.model(item), self._unwanted
        for key, made in self._made.items():
            if rough is not None and made is rough and item.collider == HULLS:
                item = replace(item, x=key[-1])  # of the shape that the rough one has
        self._making = (said("{name}: making a collider", name=item.name), 0.0)
        things = self._things(file) if rough is None and item.name == BACKGROUND else {}
        stands = self._stands

        def report(what: str, part: float) -> None:
            if unwanted.is_set():
                raise Unwanted
            self._making = (f"{item.name}: {what}", part)

        def work() -> None:
            try:
                done = None
                if things and item.collider == HULLS:
                    done = ground_at_once(item, model, things)
                future.set_result(done or make(file, item, model, report, rough, stands))
            except Unwanted:
                future.cancel()
            except BaseException as error:  # handed to the window's thread, which raises it again
                future.set_exception(error)

        self._thread = threading.Thread(target=work, name="colliders", daemon=True)
        self._thread.start()

    def _things(self, file: SceneFile) -> "dict[str, tuple[SceneItem, Collider]]":
        """What moves and has a collider, by name."""
        found = ((item, self._collider(item)) for item in file.items if not item.static)
        return {item.name: (item, made) for item, made in found if made is not None}


@dataclass(frozen=True)
class Stood:
    """How a thing stood when its ground was made."""

    world_from_object: np.ndarray  # (4, 4)
    corners: np.ndarray  # (V, 3) metres, world
    plane: "Plane"


@dataclass(frozen=True)
class Done:
    """What a thread has made."""

    key: tuple
    collider: "Collider | None"  # None: there is none
    problem: str = ""  # one sentence, why; or why it is a rough one
    rough: "Collider | None" = None  # in whose place it comes
    stands: "Mapping[str, Stood]" = field(default_factory=dict)
    pressed: "Mapping[tuple, Collider]" = field(
        default_factory=dict
    )  # rough ones, onto their plane


class Unwanted(Exception):
    """Nobody waits for the collider any more."""


def made_of(item: SceneItem) -> tuple[str | None, ModelKey, bool]:
    """What an object's collider depends on; a background's is open inside, a room."""
    return item.collider, key_of(item), item.name == BACKGROUND


def making_of(item: SceneItem) -> tuple:
    """The same with the shape that its splats have at its x."""
    return (*made_of(item), item.x if item.collider == HULLS else 0.0)


def make(
    file: SceneFile, item: SceneItem, model: Model, report: Progress, rough: "Collider | None",
    stands: "Mapping[str, Stood] | None" = None,
) -> Done:  # fmt: skip
    """The rough collider, with one the exact; or None, with one that one, and why.

    stands: how things stood, by name.
    """
    from shapeshift.scene.colliders.collider import Making
    from shapeshift.scene.colliders.collider_files import one_collider
    from shapeshift.scene.colliders.quick_ground import stood

    rest = "It cannot be touched." if rough is None else "It is touched as one hull."
    instead = rough and replace(rough, rough=False)  # is not tried again
    key, problem, stands = making_of(item), "", stands or {}
    on_it = [(one.corners, one.plane) for one in stands.values() if item.name == BACKGROUND]
    making = Making(progress=report, rough=rough is None)
    try:
        made = one_collider(file, item, model, making, on_it)
        if item.name in stands and item.collider == HULLS:
            stand = stands[item.name]
            made = stood(made, stand.world_from_object, stand.plane)
    except BadFile as error:
        made, problem = instead, f"{error} {rest}"
    except MemoryError:
        made = instead
        problem = f"'{item.name}' needs more memory for its collider than there is. {rest}"
    return Done(key, made, problem, rough)


def ground_at_once(
    item: SceneItem, model: Model, things: "Mapping[str, tuple[SceneItem, Collider]]"
) -> Done | None:
    """A background's rough collider, and things that stand on it, pressed onto it; None: there is
    none that is quick.
    """
    from shapeshift.scene.colliders.quick_ground import ground_of_model, stood

    stands: dict[str, Stood] = {}
    poses = {name: thing.pose.matrix() for name, (thing, _) in things.items()}
    corners = {
        name: np.concatenate(made.parts) @ poses[name][:3, :3].T + poses[name][:3, 3]
        for name, (_, made) in things.items()
    }
    collider, found = ground_of_model(model, item.x, item.pose, list(corners.values()))
    if collider is None:
        return None
    rough: dict[tuple, Collider] = {}
    for (name, (thing, made)), plane in zip(things.items(), found, strict=True):
        if plane is not None:
            stands[name] = Stood(poses[name], corners[name], plane)
            if made.rough:
                rough[making_of(thing)] = stood(made, poses[name], plane)
    return Done(making_of(item), collider, stands=stands, pressed=rough)
