"""What a person asked for cannot be done: the message is one sentence for them."""


class UsageError(ValueError):
    """An option or a combination of options that cannot work."""
