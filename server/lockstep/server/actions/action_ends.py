"""Who waits for the end of an action."""

import asyncio

from lockstep.protocol.actions import ActionUpdate
from lockstep.server.actions.action_requests import ActionAnswer, answered

__all__ = ["ActionEnds"]


class ActionEnds:
    """The requests that wait for the last update of an action, each for a second at most."""

    def __init__(self) -> None:
        self._waiting: dict[str, list[ActionAnswer]] = {}  # by id of the action

    def __len__(self) -> int:
        return len(self._waiting)

    async def wait(self, id: str) -> ActionUpdate:
        """Wait for the end of an action. Raises Unconfirmed."""
        end: ActionAnswer = asyncio.get_running_loop().create_future()
        waiting = self._waiting.setdefault(id, [])
        waiting.append(end)
        try:
            return await answered(end)
        finally:
            waiting.remove(end)
            if not waiting:
                del self._waiting[id]

    def updated(self, update: ActionUpdate) -> None:
        """Take the robot's news of an action."""
        if self._waiting and update.state != "running":
            self._tell(self._waiting.get(update.id, []), update)

    def clear(self) -> None:
        """Tell everyone who waits that no answer comes: the robot bridge has ended."""
        for waiting in self._waiting.values():
            self._tell(waiting, None)

    @staticmethod
    def _tell(waiting: list[ActionAnswer], update: ActionUpdate | None) -> None:
        for end in waiting:
            if not end.done():
                end.set_result(update)
