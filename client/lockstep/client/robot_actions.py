"""The actions, the status and the place of the robot, as the console reports them, and requests for actions."""

import asyncio
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from functools import partial

from lockstep.client.control.driving import Driving
from lockstep.client.errors import (
    ActionCancelled,
    ActionFailed,
    ActionRefused,
    CommandRefused,
    ConsoleLost,
    NotArmed,
)
from lockstep.client.session import Session
from lockstep.client.transport.transport import Transport
from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, ParameterValue, Status
from lockstep.protocol.description import Action
from lockstep.protocol.maps import Navigation
from lockstep.protocol.neutral import neutral_values

__all__ = ["RobotActions", "RobotNews"]

KEPT = 64  # newest actions
ANSWER_SECONDS = 5.0  # for the robot to answer a request, or to end an action that nothing renews any more


class RobotNews:
    """The console's reports of actions, status and the map. No I/O.

    Attributes:
        status: the newest status; None before the first
        status_at: the arrival of `status`, s on the loop's clock
        navigation: the newest navigation; None before the first
        navigation_at: the arrival of `navigation`, s on the loop's clock
    """

    def __init__(self) -> None:
        self.updates: OrderedDict[str, ActionUpdate] = OrderedDict()  # by id of the request, oldest first
        self.status: Status | None = None
        self.status_at = 0.0
        self.navigation: Navigation | None = None
        self.navigation_at = 0.0

    def hear(self, message: ActionUpdate | Status | Navigation, now: float) -> None:
        if isinstance(message, Navigation):
            self.navigation, self.navigation_at = message, now
            return
        if isinstance(message, Status):
            self.status, self.status_at = message, now
            return
        self.updates[message.id] = message
        if len(self.updates) > KEPT:
            self.updates.popitem(last=False)


class RobotActions:
    """Asks for actions, and renews those that move the robot until they have ended."""

    def __init__(
        self,
        transport: Transport,
        session: Session,
        driving: Driving,
        news: RobotNews,
        until: Callable[[Callable[[], bool]], Awaitable[None]],
    ) -> None:
        """`until`: waits until a message makes a condition true."""
        self._transport = transport
        self._session = session
        self._driving = driving
        self._news = news
        self._until = until

    async def act(
        self, name: str, parameters: Mapping[str, ParameterValue], progress: Callable[[ActionUpdate], None] | None
    ) -> ActionUpdate:
        """Ask for an action; return its last update. `Console.act` says what it raises."""
        action = next((each for each in self._driving.robot.description.actions if each.name == name), None)
        if action is None:
            raise ActionRefused("unknown_action", name)
        if not self._session.holds_seat:
            raise ActionRefused("no_seat")
        sender = self._driving.driver.sender
        if sender.newest is not None and sender.newest.stop.stopped:
            raise ActionRefused("stopped", sender.newest.stop.reason)
        if action.moves and not sender.readiness.ready:
            raise NotArmed
        if action.moves and sender.intention.action:
            raise ActionRefused("busy", "this connection moves the robot by another action")
        nonce = 0 if sender.newest is None else sender.newest.nonce
        id = secrets.token_hex(16)
        self._transport.send("session", Act(id=id, name=name, parameters=dict(parameters), nonce=nonce))
        try:
            update = await (self._renewed(id, progress) if action.moves else self._watched(id, progress))
        except BaseException:
            with suppress(ConsoleLost):
                self._transport.send("session", ActionCancel(id=id))
            raise
        return _outcome(update, action)

    async def _watched(self, id: str, progress: Callable[[ActionUpdate], None] | None) -> ActionUpdate:
        """Wait for the end of an action. The first answer has to come soon; the end may take any time."""
        told: ActionUpdate | None = None
        while told is None or told.state == "running":
            if told is None:
                await self._answer(lambda: id in self._news.updates)
            else:
                await self._until(partial(self._is_news, id, told))
            told = self._news.updates.get(id)
            if told is None:
                raise ActionCancelled("interrupted", "the console has forgotten the action")
            if progress is not None:
                progress(told)
        return told

    async def _renewed(self, id: str, progress: Callable[[ActionUpdate], None] | None) -> ActionUpdate:
        """Send armed events that name the action until it has ended."""
        intention = self._driving.driver.sender.intention
        intention.action = id
        try:
            async with asyncio.TaskGroup() as tasks:
                renewing = tasks.create_task(self._renew())
                ended = await self._watched(id, progress)
                renewing.cancel()
            return ended
        except BaseExceptionGroup as errors:
            raise errors.exceptions[0] from None
        finally:
            if intention.action == id:
                intention.action = ""

    async def _renew(self) -> None:
        """Send neutral commands as fast as answers come. Where they are refused, the robot ends the action itself."""
        neutral = neutral_values(self._driving.robot.description.axes)
        with suppress(CommandRefused):
            while True:
                await self._driving.driver.drive(neutral)

    def _is_news(self, id: str, known: ActionUpdate) -> bool:
        return self._news.updates.get(id) != known

    async def _answer(self, condition: Callable[[], bool]) -> None:
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                await self._until(condition)
        except TimeoutError:
            raise ConsoleLost(f"no answer from the robot within {ANSWER_SECONDS:g} s") from None


def _outcome(update: ActionUpdate, action: Action) -> ActionUpdate:
    if update.state == "refused":
        if update.reason == "not_neutral":
            raise NotArmed
        raise ActionRefused(update.reason, update.text)
    if update.state == "cancelled":
        raise ActionCancelled(update.reason, update.text)
    if update.state == "failed":
        raise ActionFailed(update.text or f"{action.label} failed")
    return update
