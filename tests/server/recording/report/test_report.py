"""The thesis' figures of a recorded session."""

from pathlib import Path

from lockstep.server.recording.report.report import write_report
from lockstep.server.recording.report.session import read_session
from tests.server.recording.makers import Story


def test_a_session_becomes_series_over_time(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80, force_at=20).write(path)
    session = read_session(path)
    assert session.robot.values == list(range(1, 81))
    assert session.streams["front"].captured.values == list(range(2, 81))
    assert session.streams["front"].gap.values == [1, 1, 1]
    assert {round(each) for each in session.answered.values} == {10}
    assert max(session.force.values) == 5.0


def test_the_report_draws_every_stream_and_says_what_was_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80, force_at=20).write(path)
    text = write_report(path, tmp_path / "a.html").read_text()
    assert text.count("<svg") == 6  # events, camera, microphone, delays, force, axes
    assert "front: server" in text
    assert "times not" not in text
