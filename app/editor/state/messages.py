"""What the viewer has to say: one note that fades, and problems that stay until they are read."""

MOST_PROBLEMS = 3  # seen at once; the oldest go
LONGEST = 700  # letters of a problem
NOTE_S = 3.0  # how long a note of a line stays


class Messages:
    """Times are seconds of any one clock, and come from outside."""

    def __init__(self) -> None:
        self.note = ""  # said for a few seconds
        self.problems: list[str] = []  # one sentence each, the newest last
        self.count = 0  # notes and problems that there have been
        self._until, self._held = 0.0, ""

    def say(self, text: str, now: float, seconds: float | None = None) -> None:
        """Shows a note, longer for more lines; "" takes it away."""
        self.note = text
        self.count += bool(text)
        self._until = now + (seconds or NOTE_S * (1 + text.count("\n")))

    def hold(self, text: str, now: float) -> None:
        """Shows what goes on, again and again; another note is let have its time."""
        if not self.note or self.note == self._held:
            self.say(text, now)
            self._held = text

    def ended(self, now: float) -> bool:
        """True once when the note's time is over; it is gone then."""
        over = bool(self.note) and now >= self._until
        if over:
            self.note = ""
        return over

    def fail(self, sentence: str) -> None:
        """Adds a problem; the same again is kept once, as the newest."""
        if len(sentence) > LONGEST:
            sentence = sentence[: LONGEST - 1] + "\u2026"
        self.count += 1
        others = [other for other in self.problems if other != sentence]
        self.problems = [*others, sentence][-MOST_PROBLEMS:]

    def dismiss(self, sentence: str) -> None:
        """Somebody has read it."""
        self.problems = [other for other in self.problems if other != sentence]

    def dismiss_newest(self) -> bool:
        """The last one; False where there is none."""
        found = bool(self.problems)
        self.problems = self.problems[:-1]
        return found


def number(count: float) -> str:
    """A whole number in groups of three."""
    return f"{count:,.0f}".replace(",", "\u2009")
