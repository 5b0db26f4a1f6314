"""A folder of downloads in which every name that a program might load does harm: it leaves a mark.

Modules and packages of every name that Python can import here, settings of libraries, and what the
linkers of OpenCL drivers pick up.
"""

import os
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
MARK = "SHAPESHIFT_POISONED"  # environment: the file that poison writes its name into
POISON = f"""import os
with open(os.environ[{MARK!r}], "a") as mark:
    mark.write(__file__ + "\\n")
raise SystemExit("poisoned")
"""
SETTINGS = {
    "matplotlibrc": "backend: module://antigravity\nno such key: 1\n",
    "libgcc_s.so.1": "INPUT(/poisoned.o)\n",  # a linker script: the link fails
    "libm.so.6": "INPUT(/poisoned.o)\n",
    "libOpenCL.so.1": "no library",
    "setup.py": POISON,
    "conftest.py": POISON,
    "pytest.ini": "[pytest]\naddopts = -p poisoned_plugin\n",
    "pyproject.toml": "[tool.pytest.ini_options]\naddopts = '-p poisoned_plugin'\n",
    "setup.cfg": "[easy_install]\nindex_url = /poisoned\n",
    "pip.conf": "[global]\nindex-url = /poisoned\n",
    "pip.ini": "[global]\nindex-url = /poisoned\n",
    "pyvenv.cfg": "home = /poisoned\n",
    "requirements.txt": "./poisoned\n",
    "poison.pth": "import poisoned_plugin\n",
}


def importable_names() -> set[str]:
    """The first name of every module that can be imported here, ours among them."""
    ours = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    loaded = {name.partition(".")[0] for name in sys.modules}
    found = {*sys.stdlib_module_names, *packages_distributions(), *loaded, *ours}
    found |= {"sitecustomize", "usercustomize", "shapeshift", "poisoned_plugin"}
    return {name for name in found if name.isidentifier()}


def fill(folder: Path) -> None:
    """Puts the poison into a folder."""
    for name, text in SETTINGS.items():
        (folder / name).write_text(text)
    for name in importable_names():
        (folder / f"{name}.py").write_text(POISON)
    for path in ROOT.glob("*/__init__.py"):  # packages come before modules of the same name
        ours = folder / path.parent.name
        ours.mkdir()
        for name in ("__init__", "__main__", "cli", "first_start"):
            (ours / f"{name}.py").write_text(POISON)
    for name in ("include", "CL"):  # where kernels' includes are looked for
        (folder / name).mkdir()


def environment(mark: Path, **more: str) -> dict[str, str]:
    """The environment of a program that is started in the folder."""
    taken = ("PYTHONPATH", "PYTHONSAFEPATH", "DISPLAY", "WAYLAND_DISPLAY")
    return {k: v for k, v in os.environ.items() if k not in taken} | {MARK: str(mark)} | more
