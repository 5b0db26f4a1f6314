"""The program: `python -m shapeshift ...`, or this file by its path with nothing else on the path.

launch.py starts it in the second way.  Then the package is made known to Python by hand, so that
neither the checkout nor the current folder has to lie on sys.path.
"""

import importlib.util
import os
import sys

NAME = "shapeshift"
HERE = os.path.dirname(os.path.abspath(__file__))


def register_package() -> None:
    """Makes `import shapeshift` give the package that this file lies in."""
    spec = importlib.util.spec_from_file_location(
        NAME, os.path.join(HERE, "__init__.py"), submodule_search_locations=[HERE]
    )
    assert spec is not None and spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules[NAME] = package
    spec.loader.exec_module(package)


if NAME not in sys.modules:  # also in processes that multiprocessing spawns
    register_package()

if __name__ == "__main__":
    from shapeshift.app.cli import main

    raise SystemExit(main())
