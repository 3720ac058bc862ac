"""The Python client of recorded episodes, against a real console."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from lockstep.client import ConnectFailed, EditRefused, RecordedEpisodes, SignallingRefused
from lockstep.server.recording.settings import RecordingSettings
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording
from tests.server.rig import Rig, running_rig


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    directory = tmp_path / "recordings"
    directory.mkdir()
    recording(directory / "one.mcap", *KEPT_AND_NOT)
    settings = RecordingSettings(directory=directory, free_bytes=0, age_days=100_000)
    async with running_rig(recording=settings) as rig:
        yield rig


def _link(rig: Rig, role: str) -> str:
    return f"{rig.url}/#token={rig.access.issue(role, role)}"  # type: ignore[arg-type]


async def test_episodes_are_listed_looked_at_changed_and_all_is_taken_back(rig: Rig) -> None:
    async with RecordedEpisodes(_link(rig, "supervisor")) as recorded:
        (first,) = await recorded.recordings()
        assert [each.state for each in first.episodes] == ["kept", "discarded", "kept", "cut", "open"]
        picture = await recorded.picture("one", first.cameras[0], 15, 160)
        assert (picture.stamp, picture.jpeg[:2]) == (15, b"\xff\xd8")
        now = await recorded.relabel(first, "a", task="pull", outcome="failure")
        now = await recorded.trim(now, "a", 11, 19)
        now = await recorded.split(now, "a", 15)
        now = await recorded.discard(now, "edit-3b")
        now = await recorded.restore(now, "edit-3b")
        now = await recorded.merge(now, "edit-3a", "edit-3b")
        kept = now.episodes[0]
        assert (kept.id, kept.task, kept.outcome) == ("edit-6", "pull", "failure")
        assert (kept.first_event, kept.last_event, now.revision) == (11, 19, 6)
        for change in (6, 5, 4, 3, 2, 1):
            now = await recorded.undo(now, change)
        assert now.episodes == first.episodes
        with pytest.raises(EditRefused) as stale:
            await recorded.relabel(first, "a", task="late")
        assert stale.value.reason == "stale_edit"
        with pytest.raises(EditRefused) as refused:
            await recorded.restore(await recorded.of("one"), "b")
        assert refused.value.reason == "edit_refused"
        report = await recorded.report("one")
        assert report.startswith(b"<!doctype html>")


async def test_who_only_watches_changes_nothing_and_an_absent_console_is_said(rig: Rig) -> None:
    identity = rig.access.verify(rig.access.issue("observer", "Eve"))
    early = rig.access.sign(identity._replace(issued=0.0), 0.0)
    async with RecordedEpisodes(f"{rig.url}/#token={early}") as recorded:
        (found,) = await recorded.recordings()
        with pytest.raises(SignallingRefused, match="not_allowed"):
            await recorded.discard(found, "a")
    async with RecordedEpisodes("http://127.0.0.1:9/#token=x") as recorded:
        with pytest.raises(ConnectFailed):
            await recorded.recordings()
