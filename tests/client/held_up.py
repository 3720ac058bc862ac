"""What a user does again after a busy machine held up the robot."""

from collections.abc import Callable

from lockstep.client import ActionCancelled, Console
from lockstep.protocol.actions import ActionUpdate

__all__ = ["ATTEMPTS", "HELD_UP", "act_on"]

ATTEMPTS = 5
HELD_UP = ("not_renewed", "interrupted")  # reasons of an action that ended because this process or the bridge was


async def act_on(console: Console, name: str, progress: Callable[[ActionUpdate], None] | None = None) -> ActionUpdate:
    """Ask for an action that moves the robot; ask again where it ended because somebody was held up."""
    for _ in range(ATTEMPTS):
        try:
            return await console.act(name, progress=progress)
        except ActionCancelled as cancelled:
            if cancelled.reason not in HELD_UP:
                raise
            await console.arm()
    return await console.act(name, progress=progress)
