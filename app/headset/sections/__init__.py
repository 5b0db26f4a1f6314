"""Sections of the panel that a headset alone has."""
