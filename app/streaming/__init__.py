"""Scenes for viewers that load what is seen."""
