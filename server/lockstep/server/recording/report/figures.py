"""Draws the thesis' figures of a recorded session, and others for an operator, as SVG text. Needs matplotlib."""

import math
from collections.abc import Callable
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes

from lockstep.protocol.description import Axis
from lockstep.server.recording.report.drawing import BAD, BAND, FAINT, MEDIUM, ROBOT, STYLE, new_figure, svg_text
from lockstep.server.recording.report.session import Series, Session, Shown
from lockstep.server.recording.report.way_figures import slowest_table, ways_svg

__all__ = ["Figure", "session_figures"]

MARK_COLOURS = {"contact": "#8a4fbf", "refusal": MEDIUM, "stop": BAD, "reset": BAND, "seat": ROBOT}


class Figure(NamedTuple):
    name: str  # of the figure's file
    title: str
    words: str
    svg: str
    below: str = ""  # HTML that belongs to it


class Panel(NamedTuple):
    title: str
    ylabel: str
    draw: Callable[[Axes], None]


def session_figures(session: Session) -> list[Figure]:
    """Return the figures for which the recording has data."""
    found = [
        _figure(
            session,
            "robot",
            "Event reference",
            "Where the robot measured it, and where the operator's page reported it.",
            [
                [
                    Panel("Robot server", "event reference", _line(session.robot, ROBOT)),
                    Panel("Robot client", "event reference", _line(session.operator, ROBOT)),
                ]
            ],
            share=True,
        )
    ]
    for stream, shown in session.streams.items():
        found.append(_stream_figure(session, stream, shown))
    found.append(_delays(session))
    if (ways := _ways(session)) is not None:
        found.append(ways)
    if session.force.values:
        found.append(_force(session))
    found.append(_axes(session))
    return found


def _stream_figure(session: Session, stream: str, shown: Shown) -> Figure:
    count = Series(shown.captured.times, [float(number) for number in range(1, len(shown.captured.times) + 1)])
    rows = [
        [
            Panel(f"{stream}: server", "event reference", _line(shown.captured, MEDIUM)),
            Panel(f"{stream}: client", "event reference", _line(shown.stamp, MEDIUM)),
        ],
        [
            Panel(f"{stream}: server", "captured", _line(count, FAINT)),
            Panel(f"{stream}: client", "rendered", _line(shown.rendered, FAINT)),
        ],
        [
            Panel(f"{stream}: gap when rendered", "events", _gap(shown)),
            Panel(f"{stream}: behind the robot", "events", _against(session.operator, shown.stamp)),
        ],
    ]
    words = "Left the captures, right the statistics of the operator's page a few times a second."
    return _figure(session, f"stream-{stream}", stream, words, rows)


def _delays(session: Session) -> Figure:
    rows = [
        [
            Panel("Command to feedback, at the console", "ms", _line(session.answered, ROBOT)),
            Panel("Command to picture, at the operator", "ms", _line(session.picture_delay, MEDIUM)),
        ]
    ]
    return _figure(session, "delays", "Delays", "Each by one clock alone.", rows)


def _ways(session: Session) -> Figure | None:
    traced = session.traced
    shown = [each for each in ("", *traced.streams) if traced.of(each)]
    if not shown:
        return None
    words = (
        "Of each short time the slowest event, from the stick to the feedback and from the capture to the canvas. "
        "Each part is measured on one machine's own clock; network is what is left of the whole round. What the "
        "operator's page has measured is known of the slowest events, and of its large view."
    )
    tables = "".join(slowest_table(traced, each) for each in shown)
    return Figure("ways", "Where each millisecond went", words, ways_svg(traced, shown, session.seconds), tables)


def _force(session: Session) -> Figure:
    def draw(axes: Axes) -> None:
        _line(session.force, ROBOT)(axes)
        for mark in session.marks:
            colour = MARK_COLOURS.get(mark.kind)
            if colour is not None:
                axes.axvline((mark.time - session.began) / 1e6, color=colour, linewidth=0.8, alpha=0.7)

    words = "Lines: " + ", ".join(MARK_COLOURS) + "."
    return _figure(session, "force", "Force", words, [[Panel("Force at the sensor", "N", draw)]])


def _axes(session: Session) -> Figure:
    moved = [axis for axis in session.description.axes if _was_driven(axis, session.commanded.get(axis.name, Series()))]
    shown = moved or list(session.description.axes[:1])

    def drawing(name: str) -> Callable[[Axes], None]:
        def draw(axes: Axes) -> None:
            _line(session.commanded.get(name, Series()), FAINT, "commanded")(axes)
            if name in session.applied:
                _line(session.applied[name], MEDIUM, "applied goal")(axes)
            _line(session.measured.get(name, Series()), ROBOT, "measured")(axes)
            axes.legend(loc="upper left")

        return draw

    rows = [[Panel(axis.label, axis.unit, drawing(axis.name))] for axis in shown]
    return _figure(session, "axes", "Axes", "Those that were moved.", rows)


def _was_driven(axis: Axis, commanded: Series) -> bool:
    """Return whether a command moved the axis: a goal at 0 does, a rate of 0 does not."""
    if axis.kind == "goal":
        return not all(map(math.isnan, commanded.values))
    return any(commanded.values)


def _figure(
    session: Session, name: str, title: str, words: str, rows: list[list[Panel]], *, share: bool = False
) -> Figure:
    with mpl.rc_context(STYLE):
        figure, grid = new_figure(len(rows), len(rows[0]))
        for line, panels in zip(grid, rows, strict=True):
            for axes, panel in zip(line, panels, strict=True):
                panel.draw(axes)
                if not any(len(line.get_xdata()) for line in axes.lines):
                    _say_empty(axes, ticks=share)
                axes.set_title(panel.title)
                axes.set_ylabel(panel.ylabel)
                axes.set_xlabel("time (s)")
                axes.set_xlim(0, max(session.seconds, 0.1))
            if share:
                line[1].sharey(line[0])
        return Figure(name, title, words, svg_text(figure))


def _say_empty(axes: Axes, *, ticks: bool) -> None:
    """Say that there is nothing to draw. `ticks`: keep those of the axes beside it."""
    axes.text(0.5, 0.5, "nothing was reported", transform=axes.transAxes, ha="center", va="center", color=FAINT)
    if not ticks:
        axes.set_yticks([])


def _line(series: Series, colour: str, label: str = "") -> Callable[[Axes], None]:
    def draw(axes: Axes) -> None:
        axes.plot(series.times, series.values, drawstyle="steps-post", color=colour, linewidth=1.2, label=label)

    return draw


def _gap(shown: Shown) -> Callable[[Axes], None]:
    def draw(axes: Axes) -> None:
        times, tolerance = shown.tolerance.times, shown.tolerance.values
        axes.fill_between(times, [-each for each in tolerance], tolerance, step="post", color=BAND, alpha=0.12, lw=0)
        _line(shown.gap, MEDIUM)(axes)

    return draw


def _against(operator: Series, stamp: Series) -> Callable[[Axes], None]:
    """Return a drawing of the stamp against the operator's event; both come with the same reports."""
    known = dict(zip(operator.times, operator.values, strict=True))
    times = [time for time in stamp.times if time in known]
    behind = [known[time] - value for time, value in zip(stamp.times, stamp.values, strict=True) if time in known]
    return _line(Series(times, behind), MEDIUM)
