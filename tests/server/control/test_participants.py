"""Notes of a session, among real peers."""

import pytest

from lockstep.protocol.console import Note, SharedNote
from tests.server.rig import Rig, eventually, running_rig

CODE = "the code of the door is 4711"


async def _told_to_a_newcomer(rig: Rig, writes: str) -> list[str]:
    """The notes that come before its own."""
    async with rig.peer("observer") as peer:
        peer.send("session", Note(text=writes))
        own = await peer.until(lambda each: isinstance(each, SharedNote) and each.text == writes)
        return [each.text for each in peer.heard if isinstance(each, SharedNote) and each is not own]


@pytest.mark.parametrize(("gap", "told"), [(0.0, []), (3600.0, [CODE, "one"])])
async def test_notes_of_a_session_that_is_over_are_told_to_no_newcomer_though_the_last_two_left_together(
    gap: float, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.control.notes.SESSION_GAP", gap)
    async with running_rig() as rig:
        async with rig.peer("operator") as peer:
            peer.send("session", Note(text=CODE))
            await peer.until(lambda each: isinstance(each, SharedNote))
            assert await _told_to_a_newcomer(rig, "one") == [CODE], "while somebody is there"
        await eventually(lambda: not list(rig.dependencies.console.peers))
        assert await _told_to_a_newcomer(rig, "two") == told
