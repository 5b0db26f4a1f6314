"""The life of a session as OpenXR draws it: what to do when the runtime says a state.  Pure."""

from dataclasses import dataclass, field

BEGIN, END = "begin", "end"  # what has to be done at once
LOST = "LOST"  # of ours, no state of the runtime's: what follows is another session


@dataclass
class Life:
    """Takes the runtime's states one after the other."""

    states: list[str] = field(default_factory=list)  # all that the runtime has named
    running: bool = False  # begun and not ended: frames have to be made
    lost: bool = False  # the runtime takes the session away

    @property
    def state(self) -> str:
        return self.states[-1] if self.states else ""

    @property
    def over(self) -> bool:
        return self.lost or self.state == "EXITING"

    @property
    def focused(self) -> bool:
        """Whether hands act on us: else a menu of the runtime has them."""
        return self.state == "FOCUSED"

    def enter(self, state: str) -> str:
        """Notes a state; returns BEGIN, END or "" for nothing to do."""
        self.states.append(state)
        if state == "READY":
            self.running = True
            return BEGIN
        if state == "STOPPING":
            self.running = False
            return END
        if state == "LOSS_PENDING":
            self.lost, self.running = True, False
        return ""
