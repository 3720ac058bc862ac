"""Writes one page with all figures and tables, in one file that needs no other."""

import html
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from lockstep.bench.experiment.endurance.growth import Growth
from lockstep.bench.experiment.judge.figures import (
    client_against_medium,
    gap_figure,
    growth_figure,
    medium_figure,
    robot_figure,
)
from lockstep.bench.experiment.judge.findings import Cell, Findings
from lockstep.bench.experiment.judge.record import ClientRecord, Run
from lockstep.bench.experiment.judge.results import Result
from lockstep.bench.experiment.judge.table import COLUMNS, rows_of
from lockstep.server.recording.report.drawing import PAGE_STYLE

__all__ = ["write_report"]

MODE_WORDS = {
    "off": "without synchronisation",
    "age": "gate by age, 0.5 s",
    "feedback": "event gate, feedback pacing: the thesis' rule",
    "media": "event gate, media pacing",
}
PANEL_TITLES = {
    "off": "without",
    "age": "gate by age",
    "feedback": "with: feedback pacing",
    "media": "with: media pacing",
}
VERDICT_WORDS = {
    "no_violation": "nothing beyond the tolerance behind the event gate",
    "pixels_agree": "pixels show the event that the stamp says",
    "nobody_lost": "every connection held",
    "rendered_90_percent": "at least 90 % of received pictures rendered",
    "within_99_percent": "picture on screen within tolerance at least 99 % of the time",
    "rested_within_hold": "at rest within hold",
    "nothing_queued_executed": "nothing queued was executed",
    "control_within_2_s": "control back within 2 s",
}


def write_report(findings: Findings, folder: Path) -> Path:
    """Write `index.html` into `folder`, and the figures that compare as separate files; return the page."""
    figures = folder / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    for name, svg in _comparisons(findings):
        (figures / f"{name}.svg").write_text(_standing_alone(svg), encoding="utf-8")
    target = folder / "index.html"
    target.write_text(_page(findings), encoding="utf-8")
    return target


def _comparisons(findings: Findings) -> Iterator[tuple[str, str]]:
    for name, cells in _by_profile(findings):
        for what in ("video", "audio"):
            svg = _compared(cells, what)
            if svg is not None:
                yield f"{name}-{what}", svg
    if findings.growth is not None:
        yield "growth", growth_figure(findings.growth)


def _standing_alone(svg: str) -> str:
    """Return the figure on white, for any background."""
    head, _, rest = svg.partition(">")
    return f'{head}><rect width="100%" height="100%" fill="#fff"/>{rest}'


def _by_profile(findings: Findings) -> list[tuple[str, list[Cell]]]:
    return [(name, list(cells)) for name, cells in groupby(findings.cells, lambda cell: cell.profile.name)]


def _page(report: Findings) -> str:
    profiles = _by_profile(report)
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        f"<title>Lockstep: experiments</title><style>{PAGE_STYLE.read_text()}</style></head><body>",
        "<header><h1>Experiments</h1><p class='lead'>What an operator was shown over each network, and how many events",
        " the robot was ahead of it. A gap beyond the tolerance is red.</p>",
        f"<p class='quiet'>{_text(_machine(report))}</p>",
        _navigation(profiles, report),
        "</header><main>",
        *([_overview(report.cells)] if report.cells else []),
        *(_profile_section(name, cells) for name, cells in profiles),
        *([_growth_section(report.growth)] if report.growth else []),
        *([_outage_section(report.outages)] if report.outages else []),
        *([_failed_section(report.failed)] if report.failed else []),
        "</main></body></html>",
    ]
    return "".join(parts)


def _machine(findings: Findings) -> str:
    facts = findings.machine
    return (
        f"{facts['cpu']}, {facts['cores']} cores; Python {facts['python']}; everything on one machine." if facts else ""
    )


def _text(value: object) -> str:
    return html.escape(str(value))


def _navigation(profiles: Sequence[tuple[str, list[Cell]]], report: Findings) -> str:
    links = [(name, cells[0].profile.title or name) for name, cells in profiles]
    links += [("growth", "Without a bound")] if report.growth else []
    links += [("outage", "Outage")] if report.outages else []
    return "<nav>" + "".join(f"<a href='#{_text(name)}'>{_text(title)}</a>" for name, title in links) + "</nav>"


def _table(head: Iterable[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table. Cells may hold the report's own markup; the first column names the row."""
    body = "".join(
        "<tr>"
        + "".join(
            f"<{'th scope=row' if not index else 'td'}>{cell}</{'th' if not index else 'td'}>"
            for index, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return (
        "<div class='wide'><table><thead><tr>"
        + "".join(f"<th scope='col'>{_text(cell)}</th>" for cell in head)
        + f"</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _main_stream(cell: Cell) -> Result:
    found: Result = cell.result["clients"][cell.run.operator.name]["streams"].get(cell.run.cameras[0], {})
    return found


def _sound(cell: Cell) -> Result:
    streams = cell.result["clients"][cell.run.operator.name]["streams"]
    return next((stream for stream in streams.values() if stream["kind"] == "audio"), {})


def _gap(stream: Result, tolerance: int) -> str:
    if not stream:
        return "–"
    tone = "bad" if stream["max_gap"] > tolerance else "good"
    return f"<span class='{tone}'>{stream['max_gap']}</span>"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"


def _overview(cells: Sequence[Cell]) -> str:
    rows = []
    for cell in cells:
        operator = cell.result["clients"][cell.run.operator.name]
        picture, sound = _main_stream(cell), _sound(cell)
        delays = operator["command_to_picture_ms"] or {}
        median, late = delays.get("median"), delays.get("p95")
        mean = picture.get("mean_gap")
        rows.append(
            [
                f"<a href='#{_text(cell.profile.name)}'>{_text(cell.profile.title or cell.profile.name)}</a>",
                _text(cell.choices.mode) + (" (Chromium)" if cell.choices.browser else ""),
                str(cell.choices.tolerance),
                _gap(picture, cell.choices.tolerance),
                "–" if mean is None else f"{mean:.2f}",
                _gap(sound, cell.choices.tolerance),
                f"{picture.get('rendered', 0)} / {picture.get('discarded', 0)} / {picture.get('held', 0)}",
                _percent(picture.get("rendered_share")),
                _percent(picture.get("within_share")),
                f"{operator['event_rate']:.1f}",
                "–" if median is None or late is None else f"{median:.0f} / {late:.0f}",
            ]
        )
    head = [
        "Network",
        "Mode",
        "T",
        "Largest picture gap",
        "Mean",
        "Largest sound gap",
        "Pictures rendered / discarded / held",
    ]
    head += ["Rendered", "On screen within T", "Events/s", "Command → picture, p50 / p95 ms"]
    return f"<section id='overview'><h2>All runs, at the operator</h2>{_table(head, rows)}</section>"


def _profile_section(name: str, cells: Sequence[Cell]) -> str:
    profile = cells[0].profile
    media = cells[0].result["media"]
    settings = (
        f"Pictures {media['video_kbps']:g} kbit/s, at most {media['frames_per_second']:g} a second; sound "
        f"{media['sound_codec']}; quality controller {'on' if media['adapts'] else 'off'}; round trip "
        f"{cells[0].result['round_trip_ms']:g} ms on average; tolerance {cells[0].choices.tolerance}."
    )
    reported = profile.experiment.reported_gap
    thesis = "" if reported is None else f" The thesis reports a largest gap of {reported} with synchronisation."
    return "".join(
        [
            f"<section id='{_text(name)}'><h2>{_text(profile.title or name)}</h2>",
            f"<p>{_text(profile.about.strip())}</p><p class='quiet'>{_text(settings)}{thesis}</p>",
            *(_verdicts(cell) for cell in cells),
            _table(
                COLUMNS[1:],
                [[_text(each) for each in row[1:]] for cell in cells for row in rows_of(cell.result)],
            ),
            _comparison_figures(cells),
            *(_cell_figures(cell) for cell in _drawn(cells)),
            "</section>",
        ]
    )


def _verdicts(cell: Cell) -> str:
    chips = "".join(
        f"<li class='{'good' if value else 'bad'}'>{_text(VERDICT_WORDS[name])}</li>"
        for name, value in cell.result["verdicts"].items()
        if value is not None
    )
    return f"<div class='verdicts'><b>{_text(cell.choices.mode)}</b><ul>{chips}</ul></div>"


def _figure(svg: str, caption: str) -> str:
    return f"<figure>{svg}<figcaption>{_text(caption)}</figcaption></figure>"


def _compared(cells: Sequence[Cell], what: str) -> str | None:
    """Draw the thesis' comparison, without and with: a panel for each mode that was run. None without such a medium."""
    runs: list[tuple[str, Run, ClientRecord]] = []
    streams: dict[str, str] = {}
    for cell in cells:
        names = cell.run.cameras if what == "video" else cell.run.microphones
        stream = next((name for name in names if cell.run.operator.rendered.get(name)), None)
        if stream is not None:
            title = PANEL_TITLES[cell.choices.mode]
            runs.append((title, cell.run, cell.run.operator))
            streams[title] = stream
    return client_against_medium(runs, streams, what) if runs else None


def _comparison_figures(cells: Sequence[Cell]) -> str:
    return "".join(
        _figure(svg, f"Event reference of the robot client and of the {what} client, in each mode.")
        for what in ("video", "audio")
        if (svg := _compared(cells, what)) is not None
    )


def _drawn(cells: Sequence[Cell]) -> Sequence[Cell]:
    """Return the cells whose figures are drawn: without and with, as in the thesis; all, if these were not run."""
    return [cell for cell in cells if cell.choices.mode in ("off", "feedback")] or cells


def _cell_figures(cell: Cell) -> str:
    run, operator = cell.run, cell.run.operator
    figures = [_figure(robot_figure(run), "Event reference at the robot server and at the robot client.")]
    for what, names in (("Video", run.cameras), ("Audio", run.microphones)):
        stream = next((name for name in names if operator.rendered.get(name)), None)
        if stream is None:
            continue
        figures.append(
            _figure(medium_figure(run, operator, stream, what), f"{what}: where it is captured and rendered.")
        )
        caption = f"Gap of everything rendered ({stream}), by all who looked on in this run; the band is the tolerance."
        figures.append(_figure(gap_figure(run, stream, cell.choices.tolerance), caption))
    opened = " open" if cell.choices.mode == "feedback" else ""
    words = MODE_WORDS[cell.choices.mode]
    return f"<details{opened}><summary>{_text(cell.choices.mode)}: {_text(words)}</summary>{''.join(figures)}</details>"


def _growth_section(growth: Growth) -> str:
    rows = [
        [
            _text({"off": "no gate", "age": "gate by age", "event": "event gate"}[point.gate]),
            f"+{point.delay:g} s",
            f"{point.event_rate:.1f}",
            f"{point.received}",
            f"{point.rendered}",
            f"<span class='{'bad' if point.max_gap > growth.tolerance else 'good'}'>{point.max_gap}</span>",
            f"{point.violations}",
        ]
        for point in growth.points
    ]
    head = ["Gate", "Player's delay", "Events/s", "Received", "Rendered", "Largest gap", "Beyond tolerance"]
    return "".join(
        [
            f"<section id='growth'><h2>Without a gate the gap has no bound ({_text(growth.profile)})</h2>",
            "<p>Somebody beside the robot drives at a fixed rate; viewers look on through the network, and their ",
            "players add a delay. Without a gate the gap is the event rate times how much later pictures are than ",
            "feedback.</p>",
            _figure(growth_figure(growth), f"The band is the tolerance, {growth.tolerance} events."),
            _table(head, rows),
            "</section>",
        ]
    )


def _outage_section(outages: Sequence[dict[str, Any]]) -> str:
    rows = [
        [
            _text(found["client"]),
            f"{found['seconds']:g} s, packets {_text(each['packets'])}, {_text(found['network'])}",
            _verdict(each["rested_within_hold"], f"{each['rest_ms']} of {each['hold_ms']} ms"),
            _verdict(each["nothing_queued_executed"], f"{each['oldest_answer_ms']} of {each['max_event_age_ms']} ms"),
            _verdict(each["control_within_2_s"], f"{each['control_ms']} ms, {each['control_round_trips']} round trips"),
        ]
        for found in outages
        for each in found["outages"]
    ]
    head = ["Client", "Outage", "At rest after the last command", "Oldest feedback that was answered", "Control back"]
    return (
        "<section id='outage'><h2>An outage in mid-drive</h2><p>Judged by the bridge's own log.</p>"
        + _table(head, rows)
        + "</section>"
    )


def _verdict(value: bool, words: str) -> str:
    return f"<span class='{'good' if value else 'bad'}'>{_text(words)}</span>"


def _failed_section(failed: Sequence[str]) -> str:
    return (
        "<section id='failed'><h2>Runs that failed</h2><ul>"
        + "".join(f"<li>{_text(each)}</li>" for each in failed)
        + "</ul></section>"
    )
