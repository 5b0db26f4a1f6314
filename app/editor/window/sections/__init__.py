"""Sections in the window."""
