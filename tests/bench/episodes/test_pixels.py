"""What the look at pixels reads from a dataset besides them."""

from pathlib import Path

from lockstep.bench.episodes.pixels import look
from lockstep.bench.episodes.turns import Span
from lockstep.server.recording.export import export_lerobot
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording


def test_rows_events_and_drivers_are_those_of_each_episode_and_a_picture_without_a_strip_is_told(
    tmp_path: Path,
) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    found = look(root)
    assert (found.rows, found.events) == ([10, 15], [(10, 19), (45, 59)])
    assert found.spans == [[Span("Ada", "human", False, 11, 20)], [Span("Ada", "human", False, 46, 60)]]
    assert (found.policy, found.interventions) == (0, 0)
    assert (found.pictures, found.unreadable, found.ok) == (25, 25, False)
