"""The person in a headset between two frames: how they stand, move, and what their hands do."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.in_hand.hand_tools import HandTools
from shapeshift.app.headset.over.glass_state import GlassState
from shapeshift.app.headset.pacing import Pacing
from shapeshift.app.headset.sections.comfort_section import NO_ROOM
from shapeshift.app.headset.sections.performance_section import Figures
from shapeshift.app.headset.worn_settings import KeptSettings
from shapeshift.scene.four_views import ALONE, FULL, has_objects
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene
from shapeshift.scene.world.world import World
from shapeshift.vr.frame import Frame, Pulse
from shapeshift.vr.locomotion import RULES, Comfort, Rules, Travel, ground_of, move
from shapeshift.vr.one_hand import alone
from shapeshift.vr.openxr.room import EYE_HEIGHT_M
from shapeshift.vr.openxr.session import Session
from shapeshift.vr.outline import Sight, look
from shapeshift.vr.panel import Palm
from shapeshift.vr.play_space import PlaySpace, lift_of, lifted, play_space_before, underfoot
from shapeshift.vr.touching import Touched, Touching, at_rest, feel, follow, touch

# A frame as it is for who wears the headset: how high they are, and which hands they have.


class Fitting:
    """Keeps by how much the room is raised: it is measured at Recentre, and stays until the next.

    `lift_m`: metres.
    """

    def __init__(self, settings: KeptSettings) -> None:
        self._settings, self.lift_m = settings, 0.0
        self._next_m = 0.0  # from the next frame on
        self._posture = settings.now.posture
        self._palm = Palm()

    def measure(self, head: Pose) -> None:
        """Of the head as the last frame had it, raised; from the next frame on it holds."""
        y = float(head.position[1]) - self.lift_m
        self._posture = self._settings.now.posture
        self._next_m = lift_of(self._posture, y, EYE_HEIGHT_M)

    def worn(self, frame: Frame, seconds: float) -> tuple[Frame, bool]:
        """The frame, and whether the room has another height since the one before."""
        moves = self._next_m != self.lift_m
        self.lift_m = self._next_m
        frame = lifted(frame, self.lift_m)
        if moves:
            frame = replace(frame, recentred=True)
        if self._posture != self._settings.now.posture:
            self.measure(frame.head)
        if side := self._settings.now.one_hand:
            frame, self._palm = alone(frame, side, self._palm, seconds)
        return frame, moves


class XrUser:
    """Keeps what the pure steps of vr/ hand on; `jumped` is called when a menu moved the room.

    `eye` is from where the scene is looked at first, world_from_eye.
    """

    def __init__(
        self, world: World, eye: Pose, floor_y: float | None, rules: Rules = RULES
    ) -> None:
        self.world, self.eye, self.floor_y, self.rules = world, eye, floor_y, rules
        self.touching, self.travel = Touching(), Travel()
        self.touched, self.comfort = Touched(), Comfort()  # of the last frame, to be shown
        self._sight = Sight()
        self._jumps = False

    def before_scene(self, frame: Frame, scale: float = 1.0) -> PlaySpace:
        """Where the scene is looked at first, on its floor."""
        return play_space_before(self.eye, frame.head, self.floor_y, scale)

    def jumped(self) -> None:
        """The room was put elsewhere or scaled: what is held comes along in the next `act`."""
        self._jumps = True

    def act(self, frame: Frame, play_space: PlaySpace, seconds: float) -> PlaySpace:
        """Before the world's steps: hands take, let go and act, and the room is moved."""
        if self._jumps:
            frame, self._jumps = replace(frame, recentred=True), False
        self.touching, self.touched = touch(self.world, self.touching, frame, play_space)
        level = play_space.point(underfoot(frame.head))[1] if self.floor_y is None else None
        play_space, self.travel, self.comfort = move(
            play_space,
            self.travel,
            at_rest(frame, self.touching),
            seconds,
            self.rules,
            ground_of(self.world, level),
        )
        if self.comfort.home:
            play_space = self.before_scene(frame)
        follow(self.world, frame, play_space, self.comfort.jumps)
        if self.rules.obstacles:
            head = play_space.point(frame.head.position)
            self._sight = look(self._sight, self.world, head, play_space.scale)
            dark = max(self.comfort.blink, self._sight.dark)
            self.comfort = replace(self.comfort, blink=dark)
        return play_space

    def felt(self, records: Sequence) -> tuple[Pulse, ...]:
        """After the world's steps: what buzzes, of these and of what the hands did."""
        return (*self.touched.pulses, *feel(self.world, records))


@dataclass
class XrState:
    """What changes from frame to frame, and what the parts of a session read of each other.

    `editor` is the scene as the panel's sections have it, on a desk too; it follows the world.
    """

    editor: EditorState
    touch: TouchState
    pacing: Pacing
    user: XrUser
    parts: PartsTool
    play_space: PlaySpace = field(default_factory=PlaySpace)
    floor_shown: bool = True
    figures: Figures | None = None  # of the last second
    sees_through: bool = False  # the runtime can show the room behind pictures
    has_insets: bool = False  # the session has a sharp inset for each eye
    offers_insets: bool = False  # the runtime would have them
    worn: KeptSettings = field(default_factory=KeptSettings)
    glass: GlassState = field(default_factory=GlassState)
    shadows: tuple[str, ...] = ()  # of these objects, on one's own table, in this frame
    shown: Scene = field(default_factory=lambda: Scene(()))  # of this frame, as it is drawn
    fit: Fitting = field(init=False)
    tools: HandTools = field(init=False)
    _was_through: bool = False  # the room itself was behind the scene

    def __post_init__(self) -> None:
        self.fit = Fitting(self.worn)
        self.tools = HandTools(self.editor, self.parts)

    def follow(self, session: Session) -> None:
        """What the runtime can show in this frame."""
        if self.sees_through and not session.sees_through:  # the vendor's cameras failed
            self.editor.messages.fail(said(NO_ROOM))
        self.sees_through = session.sees_through
        self.has_insets = session.shown.has_insets
        self.offers_insets = session.shown.offers_insets
        self.see_objects_alone()

    @property
    def through(self) -> bool:
        """Whether the room itself is behind the scene."""
        return self.sees_through and self.worn.now.passthrough

    def see_objects_alone(self) -> None:
        """Over the room a scene that has objects is seen without what was captured around them."""
        shown, was, through = self.editor.shown_scene, self._was_through, self.through
        self._was_through = through
        if through and not was and shown.show == FULL and has_objects(self.editor.scene):
            shown.show = ALONE
        elif was and not through and shown.show == ALONE:
            shown.show = FULL

    @property
    def world(self) -> World:
        """What moves and answers to touch; there is one as long as the session lasts."""
        return self.editor.bodies.living
