"""Sends a robot to a saved pose, as an operator does."""

import secrets
from collections.abc import Callable

import msgspec

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.messages import Feedback
from tests.robot_bridge.bridge_helpers import Operator

__all__ = ["ended", "send_to"]

BUSY = ("not_renewed", "interrupted", "late", "not_neutral")  # a busy machine held up what renews the action


async def send_to(
    driver: Operator, pose: str, *, until: Callable[[Feedback], bool] | None = None
) -> ActionUpdate | None:
    """Renew the action until it ends, or until the condition holds, which returns None; begin anew if it was late."""
    description = driver.link.hello.description
    assert description is not None
    neutral = [None if axis.kind == "goal" else axis.rest for axis in description.axes]
    reasons: list[str] = []
    for _ in range(20):
        if reasons:
            await driver.drive(neutral)  # its feedback comes after the end of the action before
        await driver.arm()
        id = secrets.token_hex(8)
        driver.link.send(Act(id=id, name=pose, nonce=driver.feedback.nonce, by="test"))
        driver.link.send(msgspec.structs.replace(driver.command(neutral), action=id))  # else nothing has a feedback
        while True:
            message = await driver._next((Feedback, ActionUpdate))
            if isinstance(message, Feedback):
                if until is not None and until(message):
                    return None
                driver.link.send(msgspec.structs.replace(driver.command(neutral), action=id))
            elif isinstance(message, ActionUpdate) and message.id == id and message.state != "running":
                if message.reason not in BUSY:
                    return message
                reasons.append(message.reason)
                break
    raise AssertionError(reasons)


async def ended(driver: Operator) -> ActionUpdate:
    """Return how the action ends, which nothing renews any more."""
    while (update := await driver.next(ActionUpdate)).state == "running":
        pass
    return update
