"""A script drives a world: hands and rays of its lines act at their times, step by step.

It holds no clock and draws nothing; the same file and script give the same records for ever.
"""

from collections.abc import Sequence

from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.world.read_script import Act, HandPath
from shapeshift.scene.world.record import Record
from shapeshift.scene.world.world import World

SLACK_S = 1e-9  # a line at 0.1 s belongs to step 9 of 1/90 s, whatever rounding says


class Simulation:
    """Steps a world as a script says; the world is filled and nobody else moves its hands."""

    def __init__(self, world: World, acts: Sequence[Act] = ()) -> None:
        self.world, self.acts = world, list(acts)
        self.hands = {act.hand: HandPath(acts, act.hand) for act in acts if act.do == "hand"}

    def step(self) -> Record:
        """One step of 1/hz seconds."""
        world = self.world
        for hand, path in self.hands.items():
            world.move_hand(hand, path.at(world.time_s))
        while self.acts and self.acts[0].t <= world.time_s + SLACK_S:
            act = self.acts.pop(0)
            DO[act.do](self, act)
        for hand, path in self.hands.items():
            world.move_hand(hand, path.at((world.steps + 1) / world.hz))
        return world.step()

    def grab(self, act: Act) -> None:
        self.world.move_hand(act.hand, self.hands[act.hand].at(self.world.time_s))
        self.world.grab(act.hand, act.reach_m)

    def control(self, act: Act) -> None:
        obj = self.world.object_named(act.item)
        x: Control | None = act.x
        if x is None:
            axes, balance, power = obj.item.two_axes, act.balance, act.power
            assert axes is not None and balance is not None and power is not None, "as read"
            x = axes.x(balance, power, obj.machine.blend)
        self.world.control(act.item, x)


DO = {
    "hand": lambda simulation, act: None,  # HandPath knows the way
    "grab": Simulation.grab,
    "release": lambda simulation, act: simulation.world.release(act.hand),
    "lose": lambda simulation, act: simulation.world.move_hand(act.hand, None),
    "ray": lambda simulation, act: simulation.world.ray(act.origin, act.direction),
    "control": Simulation.control,
}
