"""Writes the report of a recorded session, with the thesis' figures, as one HTML file. Needs matplotlib."""

from pathlib import Path

from lockstep.server.recording.report.figures import session_figures
from lockstep.server.recording.report.page import Figure, session_page
from lockstep.server.recording.report.session import read_session

__all__ = ["write_report"]


def write_report(recording: Path, target: Path, *, alone: bool = False) -> Path:
    """Write the report of a recording to `target`; of the whole session if it is its first part and not `alone`.

    Raises:
        RecordingError, OSError: the recording cannot be read, or the report cannot be written.
    """
    figures = [
        Figure(each.name, each.title, each.words, each.svg + each.below)
        for each in session_figures(read_session(recording, alone=alone))
    ]
    target.write_text(session_page(recording, figures, alone=alone), encoding="utf-8")
    return target
