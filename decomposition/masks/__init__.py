"""Masks of objects in photos: read, asked of a segmenter, or walked from a few hints."""
