"""Scenes in blocks: packages side by side, each with networks of its own, as one model."""
