"""What the look at pixels reads from a dataset besides them."""

from pathlib import Path

import numpy as np
import pytest

from lockstep.bench.episodes.pixels import look, strip_event
from lockstep.bench.episodes.turns import Span
from lockstep.robot_bridge.robots.event_strip import draw_event_strip
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


@pytest.mark.parametrize(("height", "width"), [(480, 640), (240, 320), (120, 160), (270, 250)])
def test_the_event_that_the_bridge_draws_is_read(height: int, width: int) -> None:
    for event in (1, 2, 0x2AAAAAAA, 2**31 - 1, 123_456_789):
        luma = np.full((height, width), 120, np.uint8)
        assert strip_event(luma) is None
        draw_event_strip(luma, event)
        assert strip_event(luma) == event
        luma[: height // 20, : width // 32] = 255 - luma[: height // 20, : width // 32]
        assert strip_event(luma) is None, "one wrong bit"
