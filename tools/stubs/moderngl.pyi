# For type checkers.  Its own types say of program["name"] that it may be four kinds of things.
from typing import Any

def __getattr__(name: str) -> Any: ...
