"""train --blocks: the coarse run, its cut, the blocks and what they become, each a command."""
