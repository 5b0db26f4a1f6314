"""Films of scenes: the command, its frames, what they become."""
