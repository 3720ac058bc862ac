"""Who waits for the end of an action, and that nobody is kept."""

import asyncio

import pytest

from lockstep.protocol.actions import ActionState, ActionUpdate
from lockstep.server.actions import action_requests
from lockstep.server.actions.action_ends import ActionEnds
from lockstep.server.errors import Unconfirmed


def update(id: str, state: ActionState) -> ActionUpdate:
    return ActionUpdate(id=id, name="home", state=state, event=7)


async def test_all_who_wait_for_an_action_are_told_of_its_end_once_and_forgotten() -> None:
    ends = ActionEnds()
    waiting = [asyncio.create_task(ends.wait(id)) for id in ("a", "a", "b")]
    await asyncio.sleep(0)
    assert len(ends) == 2
    ends.updated(update("a", "running"))
    ends.updated(update("a", "failed"))
    ends.updated(update("a", "done"))
    assert [(await each).state for each in waiting[:2]] == ["failed", "failed"]
    assert len(ends) == 1
    ends.clear()
    with pytest.raises(Unconfirmed):
        await waiting[2]
    assert len(ends) == 0


async def test_who_gives_up_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = ActionEnds()
    task = asyncio.create_task(ends.wait("a"))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    monkeypatch.setattr(action_requests, "ANSWER_SECONDS", 0.0)
    with pytest.raises(Unconfirmed):
        await ends.wait("a")
    assert len(ends) == 0
