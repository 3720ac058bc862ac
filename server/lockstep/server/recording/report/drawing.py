"""How figures look: colours, fonts and the grid of axes, drawn as SVG text. Needs matplotlib."""

import io
from importlib.resources import files
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

__all__ = ["BAD", "BAND", "FAINT", "INK", "MEDIUM", "PAGE_STYLE", "ROBOT", "STYLE", "new_figure", "svg_text"]

PAGE_STYLE = files("lockstep.server.recording.report") / "report.css"
INK, FAINT, GRID = "#16202b", "#5b6875", "#dfe5ea"
ROBOT, MEDIUM, BAD, BAND = "#1769aa", "#d1731c", "#c1272d", "#2e8b57"
WIDTH, ROW = 9.0, 2.6  # inches
STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 9,
    "svg.fonttype": "none",  # text stays text: small, and searchable
    "svg.hashsalt": "lockstep",
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
}


def new_figure(rows: int, columns: int) -> tuple[Figure, list[list[Axes]]]:
    """Make a grid of axes. Call it, and `svg_text`, within STYLE."""
    height = ROW * rows
    figure = Figure(figsize=(WIDTH, height))
    # A layout engine would draw every figure twice.
    figure.subplots_adjust(
        left=0.6 / WIDTH, right=1 - 0.1 / WIDTH, bottom=0.5 / height, top=1 - 0.3 / height, wspace=0.24, hspace=0.45
    )
    return figure, figure.subplots(rows, columns, squeeze=False).tolist()


def svg_text(figure: Figure) -> str:
    target = io.StringIO()
    figure.savefig(target, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = target.getvalue()
    return text[text.index("<svg") :]
