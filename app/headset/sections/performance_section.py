"""Figures of the frames in a headset: what a frame takes of the display's period, what is late."""

from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import rows
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.settings import FrameStats
from shapeshift.vr.pace import FramePace

RECENT = 60  # frames whose times are seen


@dataclass(frozen=True)
class Figures:
    """Of the last frames, rounded to what is shown."""

    own_ms: float  # of a frame, from the runtime's go to our hand-over: a median
    drawing_ms: float  # of own_ms, the splats of both eyes
    period_ms: float  # of the display; 0 while nothing is known
    frames: int
    dropped: int  # the runtime showed an older one in their place
    drawn: int
    splats: int

    @staticmethod
    def of(pace: FramePace, stats: FrameStats) -> "Figures":
        own, drawing = (
            round(float(np.median(times[-RECENT:])), 1) if times else 0.0
            for times in (pace.own_ms, pace.drawing_ms)
        )
        period = round(pace.period_s * 1e3, 1)
        counts = (pace.frames, pace.dropped, stats.drawn, stats.splats)
        return Figures(own, drawing, period, *counts)

    def rows(self) -> list[tuple[str, str]]:
        """(name, figure) as the panel shows them."""
        of = f" of {self.period_ms:.1f}" if self.period_ms > 0 else ""
        return [
            ("Frame", f"{self.own_ms:.1f}{of} ms"),
            ("Splats of both eyes", f"{self.drawing_ms:.1f} ms"),
            ("Late", f"{number(self.dropped)} of {number(self.frames)} frames"),
            ("Drawn", f"{number(self.drawn)} of {number(self.splats)} splats"),
        ]


def draw_figures(figures: Figures | None) -> None:
    """A row a figure; nothing is known before the first second is over."""
    if figures is None:
        imgui.text_disabled(said("after a second"))
    else:
        rows(figures.rows())
