"""The window: what it shows, what hands and files do to it."""
