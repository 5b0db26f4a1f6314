"""The example of reactions that tests play with: three small things that answer, quickly drawn."""

from pathlib import Path

TOUCH = Path(__file__).resolve().parents[2] / "examples" / "touch.scene.json"
