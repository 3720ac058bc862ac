"""Draws where each millisecond went, as stacked bars over time and as a table of the slowest events."""

import html
from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.axes import Axes

from lockstep.protocol.traces.trace import Span
from lockstep.server.recording.report.drawing import STYLE, new_figure, svg_text
from lockstep.server.recording.report.traced_events import TracedEvent, TracedEvents, slowest, slowest_by_time, way_of

__all__ = ["SPAN_WORDS", "slowest_table", "ways_svg"]

BINS = 72  # bars over the whole session
LISTED = 10  # events in a table
SHADES = {
    "bridge": ("#e8a33d", "#b9770e", "#f3cd8f", "#8a5a0a", "#d9c3a0"),
    "console": ("#3b82c4", "#1f5a91", "#7fb2e0", "#163f66", "#a9bfd3"),
    "page": ("#2f9e75", "#1d6b4f", "#79c9aa", "#114634", "#a8cbbd"),
    "between": ("#8b97a3", "#c3ccd4"),
}
SPAN_WORDS = {
    "camera_wait_ms": "camera's beat",
    "capture_ms": "capture",
    "bridge_encode_ms": "encode at the robot",
    "link_wait_ms": "wait for the robot link",
    "encoder_wait_ms": "wait for the encoder",
    "encode_ms": "encode",
    "packetise_ms": "packetise",
    "send_ms": "to the socket",
    "between_ms": "network",
    "assemble_ms": "assemble",
    "transform_ms": "transform",
    "decode_ms": "decode",
    "gate_ms": "gate",
    "draw_ms": "draw",
    "input_ms": "stick to send",
    "forward_ms": "forward",
    "link_ms": "robot link",
    "tick_wait_ms": "wait for the tick",
    "apply_ms": "apply",
    "rate_wait_ms": "event rate",
    "measure_ms": "measure",
    "back_ms": "back",
    "take_ms": "take",
}


def ways_svg(traced: TracedEvents, streams: Sequence[str], seconds: float) -> str:
    """Return one drawing with a row of bars for each of `streams`; "" stands for the commands."""
    with mpl.rc_context(STYLE):
        figure, grid = new_figure(len(streams), 1)
        for (axes,), stream in zip(grid, streams, strict=True):
            _bars(axes, traced.of(stream), stream, seconds)
        figure.subplots_adjust(right=0.8)
        return svg_text(figure)


def _bars(axes: Axes, events: list[TracedEvent], stream: str, seconds: float) -> None:
    chosen = slowest_by_time(events, stream, seconds, BINS)
    times, below = [time for time, _ in chosen], [0.0] * len(chosen)
    for span, colour in zip(way_of(stream), _colours(way_of(stream)), strict=True):
        heights = [each.spans(stream).get(span.name, 0.0) for _, each in chosen]
        if not any(heights):
            continue
        axes.bar(times, heights, seconds / BINS, below, color=colour, label=SPAN_WORDS[span.name], linewidth=0)
        below = [low + height for low, height in zip(below, heights, strict=True)]
    axes.set_axisbelow(True)
    axes.set_title(f"{stream}: picture" if stream else "Command")
    axes.set_ylabel("ms")
    axes.set_xlabel("time (s)")
    axes.set_xlim(0, max(seconds, 0.1))
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.05), fontsize=7, labelspacing=0.25, reverse=True)


def _colours(way: Sequence[Span]) -> list[str]:
    """Return a colour for each span: a hue for each clock, and shades of it in the order of the way."""
    used = dict.fromkeys(SHADES, 0)
    colours = []
    for span in way:
        shades = SHADES[span.clock]
        colours.append(shades[used[span.clock] % len(shades)])
        used[span.clock] += 1
    return colours


def slowest_table(traced: TracedEvents, stream: str) -> str:
    """Return the slowest events as an HTML table: each with its longest three parts."""
    rows = []
    for each in slowest(traced.of(stream), stream, LISTED):
        parts = sorted(each.spans(stream).items(), key=lambda part: -part[1])[:3]
        words = ", ".join(f"{SPAN_WORDS[name]} {ms:.1f}" for name, ms in parts)
        rows.append(
            f"<tr><th>{each.event}</th><td>{each.time:.1f}</td><td>{each.total(stream):.1f}</td><td>{words}</td></tr>"
        )
    about = f"{html.escape(stream)}: slowest pictures" if stream else "Slowest commands"
    return (
        f"<h3>{about}</h3><table class='ways'><thead><tr><th>event</th><th>at, s</th><th>ms</th><th>of which, ms</th>"
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )
