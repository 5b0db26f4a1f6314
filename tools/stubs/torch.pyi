# For type checkers: only the makers of fixtures want it.
from typing import Any

def __getattr__(name: str) -> Any: ...
