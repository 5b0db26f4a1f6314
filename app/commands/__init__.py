"""The other commands: none opens a window."""
