"""Coarser levels of a package learn to look like the package."""
