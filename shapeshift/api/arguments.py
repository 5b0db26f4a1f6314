"""What the functions of the library take, by name."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Literal

from numpy.typing import ArrayLike

from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.pose import View

PathText = str | PathLike[str]
X = float | str | StopWeights  # a number from 0 to 1, a stop's name, "A..B:0.5", or a blend
Camera = str | PathLike[str] | View | CameraList | Sequence[View] | ArrayLike
Size = tuple[int, int]  # width, height in pixels
Output = Literal["picture", "depth", "normal", "coverage"]
Progress = Callable[[str, float], None]  # (what is being done, part done 0..1)
Kind = Literal["cpu", "gpu"]  # of an OpenCL device
DEFAULT_SIZE = (640, 360)
