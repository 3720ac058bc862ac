"""Writes the report of a recorded session: what was kept, and figures, in one HTML file."""

import html
from datetime import UTC, datetime
from pathlib import Path

from lockstep.server.recording.report.drawing import PAGE_STYLE
from lockstep.server.recording.report.driver_figures import drivers_table
from lockstep.server.recording.report.figures import Figure, session_figures
from lockstep.server.recording.report.session import Session, read_session
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file

__all__ = ["write_report"]


def write_report(recording: Path, target: Path) -> Path:
    """Write the report of a recording to `target`.

    Raises:
        RecordingError, OSError: the recording cannot be read, or the report cannot be written.
    """
    session = read_session(recording)
    page = _page(recording, session, verify_file(recording), session_figures(session))
    target.write_text(page, encoding="utf-8")
    return target


def _page(recording: Path, session: Session, verdict: Verdict, figures: list[Figure]) -> str:
    began = datetime.fromtimestamp(session.began / 1e6, UTC)
    title = session.info.name or recording.stem
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        f"<title>Lockstep: {_text(title)}</title><style>{PAGE_STYLE.read_text()}</style></head><body>",
        f"<header><h1>{_text(title)}</h1>",
        f"<p class='lead'>{_text(session.info.robot)}, {began:%Y-%m-%d %H:%M:%S} UTC, {session.seconds:.1f} s, ",
        f"{verdict.events} events, {verdict.commands} commands, {verdict.pictures_and_sounds} pictures and sounds.</p>",
        f"</header><main>{_promises(verdict)}{drivers_table(session.drivers)}",
        *(
            f"<section id='{_text(each.name)}'><h2>{_text(each.title)}</h2><p class='quiet'>{_text(each.words)}</p>"
            f"{each.svg}{each.below}</section>"
            for each in figures
        ),
        "</main></body></html>",
    ]
    return "".join(parts)


def _promises(verdict: Verdict) -> str:
    rows = "".join(
        f"<tr><th>{name.replace('_', ' ')}</th><td>{check.looked or ''}</td>"
        f"<td><span class='{'good' if check.ok else 'bad'}'>{'kept' if check.ok else f'{check.count} times not'}</span>"
        f"</td></tr>"
        for name, check in verdict.checks.items()
    )
    return (
        f"<section><h2>Promises</h2><table><tr><th>promise</th><th>looked at</th><th></th></tr>{rows}</table></section>"
    )


def _text(value: object) -> str:
    return html.escape(str(value), quote=True)
