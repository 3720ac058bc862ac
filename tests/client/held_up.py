"""What a user does again after a busy machine held up the robot."""

from collections.abc import Callable
from contextlib import suppress

from lockstep.client import ActionCancelled, Console, NotArmed
from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.messages import Feedback

__all__ = ["ATTEMPTS", "HELD_UP", "act_on", "arm_on"]

ATTEMPTS = 5
HELD_UP = ("not_renewed", "interrupted")  # reasons of an action that ended because this process or the bridge was


async def arm_on(console: Console) -> Feedback:
    """Arm; again where the robot was held up while it was being armed."""
    for _ in range(ATTEMPTS):
        with suppress(NotArmed):
            return await console.arm()
    return await console.arm()


async def act_on(console: Console, name: str, progress: Callable[[ActionUpdate], None] | None = None) -> ActionUpdate:
    """Ask an armed robot for an action that moves it; arm and ask again where somebody was held up."""
    for _ in range(ATTEMPTS):
        try:
            return await console.act(name, progress=progress)
        except ActionCancelled as cancelled:
            if cancelled.reason not in HELD_UP:
                raise
        except NotArmed:
            pass
        await arm_on(console)
    return await console.act(name, progress=progress)
