"""Training a large capture in blocks: a coarse run of the whole, then each block on its own."""
