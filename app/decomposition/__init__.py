"""Commands that make objects of photos; each is loaded when it is asked for."""
