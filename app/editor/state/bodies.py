"""The world behind the window: colliders of the document's objects, made in a thread, then bodies.

The picture does not wait for it: a scene is there to be seen before it can be touched.  Objects are
touched as rough hulls first, and by their exact pieces when those are made.
"""

import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import replace
from typing import TYPE_CHECKING

from shapeshift.app.editor.state.files.edited_file import EditedFile, ModelKey, key_of
from shapeshift.app.editor.state.files.opened import Progress
from shapeshift.app.editor.texts.table import said
from shapeshift.app.opening import sentence
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS, SceneFile, SceneItem

if TYPE_CHECKING:
    from shapeshift.scene.colliders.collider import Collider
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
        self._ground: tuple = ()  # floor and gravity of the world
        self._future: Future | None = None
        self.stale = True  # the world does not know of the last edits yet
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
            key, made, problem, rough = future.result()
            self._exchange(key, made, rough)
            self.problem = problem or self.problem
            self.why_none = problem or self.why_none
        try:
            self._catch_up(edited)
        except BadFile as error:
            self.problem, self.stale = str(error), False
            self.why_none, self._given_up = self.problem, self.world is None
        return self.busy

    def _exchange(self, key: tuple, made: "Collider | None", rough: "Collider | None") -> None:
        """A collider, in the place of the rough one that stood in for it."""
        self._made[key] = made
        for name, (made_of_it, before) in self._of.items():
            if rough is not None and before is rough and made is not None:
                self._of[name], self.stale = (made_of_it, made), True

    def _catch_up(self, edited: EditedFile) -> None:
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
        if self.world is not None and not self.stale:
            found = ((item, self._collider(item)) for item in touched)
            rough = [(item, made) for item, made in found if made is not None and made.rough]
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
        """What was made for the object or for its like; None: it has none."""
        before = self._of_before(item)
        return self._made[making_of(item)] if before is None else before

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

        def report(what: str, part: float) -> None:
            if unwanted.is_set():
                raise Unwanted
            self._making = (f"{item.name}: {what}", part)

        def work() -> None:
            try:
                future.set_result((making_of(item), *make(file, item, model, report, rough), rough))
            except Unwanted:
                future.cancel()
            except BaseException as error:  # handed to the window's thread, which raises it again
                future.set_exception(error)

        self._thread = threading.Thread(target=work, name="colliders", daemon=True)
        self._thread.start()


class Unwanted(Exception):
    """Nobody waits for the collider any more."""


def made_of(item: SceneItem) -> tuple[str | None, ModelKey, bool]:
    """What an object's collider depends on; a background's is open inside, a room."""
    return item.collider, key_of(item), item.name == BACKGROUND


def making_of(item: SceneItem) -> tuple:
    """The same with the shape that its splats have at its x."""
    return (*made_of(item), item.x if item.collider == HULLS else 0.0)


def make(
    file: SceneFile, item: SceneItem, model: Model, report: Progress, rough: "Collider | None"
) -> "tuple[Collider | None, str]":
    """The rough collider, with one the exact; or None, with one that one, and why."""
    from shapeshift.scene.colliders.collider import Making
    from shapeshift.scene.colliders.collider_files import one_collider

    rest = "It cannot be touched." if rough is None else "It is touched as one hull."
    instead = rough and replace(rough, rough=False)  # is not tried again
    try:
        return one_collider(file, item, model, Making(progress=report, rough=rough is None)), ""
    except BadFile as error:
        return instead, f"{error} {rest}"
    except MemoryError:
        return instead, f"'{item.name}' needs more memory for its collider than there is. {rest}"
