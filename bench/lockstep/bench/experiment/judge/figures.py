"""Draws the thesis' figures, and further ones, as SVG text. Needs matplotlib."""

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.axes import Axes

from lockstep.bench.experiment.endurance.growth import Growth
from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Rendered, Run
from lockstep.server.recording.report.drawing import BAD, BAND, FAINT, MEDIUM, ROBOT, STYLE, new_figure, svg_text

__all__ = ["client_against_medium", "gap_figure", "growth_figure", "medium_figure", "robot_figure"]

MODE_COLOURS = {"off": "#c1272d", "age": "#d1731c", "event": "#1769aa", "feedback": "#1769aa", "media": "#2e8b57"}


def _steps(axes: Axes, times: Sequence[float], values: Sequence[float], colour: str, label: str) -> None:
    axes.plot(times, values, drawstyle="steps-post", color=colour, linewidth=1.3, label=label)


def _events(axes: Axes, entries: Sequence[Arrival | Rendered], began: float, colour: str, label: str) -> None:
    known = [(each.at - began, _event_of(each)) for each in entries if _event_of(each)]
    _steps(axes, [at for at, _ in known], [event for _, event in known], colour, label)


def _event_of(entry: Arrival | Rendered) -> int:
    return entry.event if isinstance(entry, Arrival) else entry.stamp or 0


def _within(run: Run, entries: Sequence[Rendered]) -> list[Rendered]:
    return [each for each in entries if each.at >= run.began]


def _label(axes: Axes, title: str, ylabel: str, run: Run) -> None:
    axes.set_title(title)
    axes.set_xlim(0, run.ended - run.began)
    axes.set_xlabel("time (s)")
    axes.set_ylabel(ylabel)


def robot_figure(run: Run) -> str:
    """Draw the event reference against time at the robot's side and at the operator's."""
    with mpl.rc_context(STYLE):
        figure, ((server, client),) = new_figure(1, 2)
        _events(server, run.robot.answered, run.began, ROBOT, "")
        _label(server, "Robot server", "event reference", run)
        _events(client, run.operator.feedbacks, run.began, ROBOT, "")
        _label(client, "Robot client", "event reference", run)
        client.sharey(server)
        return svg_text(figure)


def medium_figure(run: Run, client: ClientRecord, stream: str, what: str) -> str:
    """Draw event reference and index against time where a medium is captured and where it is rendered."""
    captured = run.robot.captured.get(stream, [])
    rendered = _within(run, client.rendered.get(stream, []))
    with mpl.rc_context(STYLE):
        figure, rows = new_figure(2, 2)
        (server_event, client_event), (server_index, client_index) = rows
        _events(server_event, captured, run.began, MEDIUM, "")
        _events(client_event, rendered, run.began, MEDIUM, "")
        index = "frame index" if what == "Video" else "segment index"
        _steps(server_index, [each.at - run.began for each in captured], range(1, len(captured) + 1), FAINT, "")
        _steps(client_index, [each.at - run.began for each in rendered], range(1, len(rendered) + 1), FAINT, "")
        for axes, side in ((server_event, "server"), (client_event, "client")):
            _label(axes, f"{what} {side}", "event reference", run)
        for axes, side in ((server_index, "server"), (client_index, "client")):
            _label(axes, f"{what} {side}", index, run)
        client_event.sharey(server_event)
        client_index.sharey(server_index)
        return svg_text(figure)


def client_against_medium(runs: Sequence[tuple[str, Run, ClientRecord]], stream_of: dict[str, str], what: str) -> str:
    """Draw robot client and media client in one picture: without and with synchronisation, side by side."""
    with mpl.rc_context(STYLE):
        figure, (row,) = new_figure(1, len(runs))
        for axes, (title, run, client) in zip(row, runs, strict=True):
            _events(axes, client.feedbacks, run.began, ROBOT, "robot client")
            _events(axes, _within(run, client.rendered.get(stream_of[title], [])), run.began, MEDIUM, f"{what} client")
            _label(axes, title, "event reference", run)
            axes.legend(loc="upper left")
        return svg_text(figure)


def gap_figure(run: Run, stream: str, tolerance: int) -> str:
    """Draw the gap of every rendering against time, for each gate mode that looked on, with the tolerance as a band."""
    clients = [client for client in run.clients if client.rendered.get(stream)]
    with mpl.rc_context(STYLE):
        figure, (row,) = new_figure(1, max(1, len(clients)))
        top = tolerance + 1.0
        for axes, client in zip(row, clients, strict=True):
            entries = [each for each in _within(run, client.rendered[stream]) if each.gap is not None]
            gaps = [each.gap or 0 for each in entries]
            times = [each.at - run.began for each in entries]
            axes.axhspan(-tolerance, tolerance, color=BAND, alpha=0.12, linewidth=0)
            axes.plot(times, gaps, drawstyle="steps-post", color=MODE_COLOURS[client.gate], linewidth=0.9)
            beyond = [(time, gap) for time, gap in zip(times, gaps, strict=True) if abs(gap) > tolerance]
            axes.plot(*(zip(*beyond, strict=True) if beyond else ([], [])), ".", color=BAD, markersize=3.5)
            _label(axes, _gate_title(client), "gap (events)", run)
            top = max(top, *(abs(gap) + 1 for gap in gaps)) if gaps else top
        for axes in row:
            axes.set_ylim(-tolerance - 1, top)
        return svg_text(figure)


def _gate_title(client: ClientRecord) -> str:
    gate = {"off": "no gate", "age": "gate by age (0.5 s)", "event": "event gate"}[client.gate]
    return f"{gate}{', the operator' if client.drives else ''}"


def growth_figure(growth: Growth) -> str:
    """Draw the largest gap against event rate, a line for each delay that a player adds, with and without a gate."""
    with mpl.rc_context(STYLE):
        figure, (row,) = new_figure(1, 3)
        top = max((point.max_gap for point in growth.points), default=1)
        shades = ["#9ec5e8", "#5f9fd4", "#2c78b7", "#0b4a80"]
        for axes, gate in zip(row, ("off", "age", "event"), strict=True):
            for shade, delay in zip(shades, growth.delays, strict=False):
                points = sorted(
                    (point.event_rate, point.max_gap)
                    for point in growth.points
                    if point.gate == gate and point.delay == delay and point.rendered
                )
                if points:
                    label = f"+{delay:g} s"
                    axes.plot(*zip(*points, strict=True), marker="o", markersize=4, color=shade, label=label)
            axes.axhspan(0, growth.tolerance, color=BAND, alpha=0.12, linewidth=0)
            axes.set_ylim(0, top * 1.08)
            axes.set_xlim(left=0)
            axes.set_title({"off": "no gate", "age": "gate by age (0.5 s)", "event": "event gate"}[gate])
            axes.set_xlabel("events a second")
            axes.set_ylabel("largest gap rendered (events)")
        handles, labels = row[0].get_legend_handles_labels()  # the last panel has room: its lines stay low
        row[2].legend(handles, labels, title="delay added by the player", title_fontsize=8.5, loc="upper right")
        return svg_text(figure)
