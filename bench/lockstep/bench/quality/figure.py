"""Draws delay and queue over time, as SVG."""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

__all__ = ["draw"]

COLOURS = {"off": "#b3392f", "on": "#1f6f8b"}
WORDS = {"off": "controller off", "on": "controller on"}


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw a column for each network: command-to-picture delay above, the queue in the network below."""
    figure = Figure(figsize=(5.2 * len(results), 5.4), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots(2, len(results), sharex="col", squeeze=False)
    for column, (name, modes) in enumerate(results.items()):
        above, below = axes[0][column], axes[1][column]
        for mode, found in modes.items():
            line = found["timeline"]
            above.plot(
                line["at"],
                line["delay_ms"],
                color=COLOURS[mode],
                marker=".",
                markersize=3,
                label=WORDS[mode],
                linewidth=1.2,
            )
            below.plot(line["at"], line["queue_ms"], color=COLOURS[mode], linewidth=1.2)
        above.set_title(name, loc="left", fontsize=11)
        above.set_ylabel("command to picture, ms")
        below.set_ylabel("queue in the network, ms")
        below.set_xlabel("s")
        for axis in (above, below):
            axis.set_ylim(bottom=0)
            axis.grid(color="#dddddd", linewidth=0.5)
            axis.spines[["top", "right"]].set_visible(False)
        above.legend(frameon=False, fontsize=9)
    figure.savefig(path, metadata={"Date": None})
