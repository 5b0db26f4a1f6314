"""What a reader behind the gate raises for a file that is not what it should be."""


class Unreadable(ValueError):
    """What is wrong with a file, without its name."""
