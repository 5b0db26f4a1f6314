"""Which renderers a module's tests draw with: RENDERERS = {name: keywords of a Renderer}.

The names are seen in the names of the tests.  tests/conftest.py makes them, one after the other.
"""

TILES: dict[str, object] = {}  # without OpenGL


def quads(**keywords: object) -> dict[str, object]:
    """Quads in the context of all tests, into floats where nothing else is said.

    pair: both eyes in one draw, which only software GL does; False: a draw an eye, as on a GPU.
    """
    return {"drawing": "quads", "target": "rgba32f"} | keywords


EITHER_ON_GL = {"quads": quads(), "tiles": quads(drawing="tiles")}
