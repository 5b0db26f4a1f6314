"""Photos without poses -> a COLMAP model: which photos, the structure from motion, its frame."""
