"""Passes requests for actions on to the robot, and keeps how each action does.

The robot bridge decides what begins and what ends an action (docs/robot-link.md, "Actions"). The console checks the
right to ask, and cancels whatever moves the robot when the control seat changes hands.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionReason, ActionUpdate, ParameterValue
from lockstep.protocol.console import PEOPLE
from lockstep.protocol.description import RobotDescription
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.actions.action_ends import ActionEnds
from lockstep.server.actions.action_requests import ActionAnswer, ActionRequests, answered
from lockstep.server.actions.action_states import ActionStates
from lockstep.server.audit.records import Actor
from lockstep.server.errors import NotFound, NotRenewable, RobotLinkDown, TooManyRequests
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionRefused,
    ActionUpdated,
    InputRefused,
    SessionEvents,
)
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["ActionService"]

ASKS, ASK_RATE = 10, 5.0  # Hz, of one link
UPDATES, UPDATE_RATE = 100, 50.0  # Hz, of the robot; further updates of progress alone are left out
STATES, STATE_RATE = 200, 20.0  # Hz, of the robot; of further new states each action's newest is told later


class ActionsRobotLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    @property
    def up(self) -> bool: ...
    @property
    def detail(self) -> str: ...
    @property
    def description(self) -> RobotDescription | None: ...
    def send(self, message: Act | ActionCancel) -> bool: ...


class ActionService:
    """Run `run` as a task. All other methods but those by HTTP are called on the loop and return at once."""

    def __init__(
        self,
        robot: ActionsRobotLink,
        clock: EventClock,
        holds_seat: Callable[[Peer], bool],
        may_move: Callable[[Peer], bool],
        events: SessionEvents,
    ) -> None:
        """`may_move`: whether a moving command of this peer would be forwarded, as far as the seat is concerned."""
        self._robot = robot
        self._clock = clock
        self._holds_seat = holds_seat
        self._may_move = may_move
        self._events = events
        self._asks = RateLimits(ASK_RATE, ASKS)
        self._cancels = RateLimits(ASK_RATE, ASKS)  # apart: whoever has asked too often can still cancel
        self._progress = TokenBucket(UPDATE_RATE, UPDATES)
        self._states = TokenBucket(STATE_RATE, STATES)
        self._kept = ActionStates()
        self._is_owing = asyncio.Event()
        self._requests = ActionRequests()
        self._ends = ActionEnds()

    def newest(self) -> list[ActionUpdate]:
        """Return how the newest actions do, oldest first, with the age of each that has ended."""
        return self._kept.newest(time.monotonic())

    def act_by_peer(self, peer: Peer, act: Act) -> None:
        """Pass on a request of the seat's holder; refuse that of anyone else."""
        if (reason := self._why_not(peer, act)) is not None:
            refused = ActionUpdate(
                id=act.id, name=act.name, state="refused", reason=reason, event=self._clock.event, by=peer.name
            )
            peer.send("session", refused)
            self._events.publish(ActionRefused(peer.actor, refused))

    def _why_not(self, peer: Peer, act: Act) -> ActionReason | None:
        if peer.role not in PEOPLE:
            return "not_allowed"  # a policy drives by commands alone
        if not self._holds_seat(peer):
            return "no_seat"
        description = self._robot.description
        if description is None:
            return "link_down"
        action = next((each for each in description.actions if each.name == act.name), None)
        if action is None:
            return "unknown_action"  # here: what a peer makes up stands in no audit
        if action.moves and not self._may_move(peer):
            return "not_neutral"  # it begins only where a moving command would execute
        if not self._asks.spend(peer.identity.token_id or peer.id, time.monotonic()):
            return "too_often"
        return None if self._send(msgspec.structs.replace(act, by=peer.name), peer.actor) else "link_down"

    def _send(self, act: Act, by: Actor, answer: ActionAnswer | None = None) -> bool:
        if not self._robot.up or not self._robot.send(act):
            return False
        self._requests.add(act, answer)
        if self._kept.get(act.id) is None:
            self._events.publish(ActionAsked(by, act))
        return True

    async def act_by_http(
        self, by: Actor, name: str, parameters: Mapping[str, ParameterValue], id: str = "", nonce: int | None = None
    ) -> ActionUpdate:
        """Ask for an action that moves nothing; return the robot's answer. The caller has checked the right to ask.

        Args:
            id: of the request; "": the console draws one. With the id of an earlier request nothing begins: the answer
                is the newest update of that one
            nonce: of the feedback that the client has seen; None: of the newest, which makes every request fresh

        Raises:
            ActionIdUsed: an earlier request with this id asked for something else.
            NotFound: the robot has no such action.
            NotRenewable: it moves the robot, and no armed events come over HTTP.
            TooManyRequests: of this link.
            RobotLinkDown, Unconfirmed: the robot cannot be asked, or has not answered.
        """
        if id in self._requests or self._kept.get(id) is not None:
            _spend(self._asks, by, "actions")
            return await self._requests.again(id, name, parameters, time.monotonic())
        description, feedback = self._robot.description, self._clock.feedback
        if description is None or feedback is None or not self._robot.up:
            raise RobotLinkDown(self._robot.detail)
        action = next((each for each in description.actions if each.name == name), None)
        if action is None:
            raise NotFound(f"the robot has no action {name!r}"[:200])
        if action.moves:
            raise NotRenewable(f"{name} moves the robot: it needs armed events on the control channel")
        _spend(self._asks, by, "actions")
        answer: ActionAnswer = asyncio.get_running_loop().create_future()
        act = Act(
            id=id or secrets.token_hex(16),
            name=name,
            parameters=dict(parameters),
            nonce=feedback.nonce if nonce is None else nonce,
            by=by.name,
        )
        if not self._send(act, by, answer):
            raise RobotLinkDown(self._robot.detail)
        return await answered(answer)

    def act_by_console(self, act: Act) -> bool:
        """Ask for an action that moves nothing, for the console itself. False: there is no link to the robot."""
        return self._send(act, Actor(name=act.by))

    def cancel_by_peer(self, peer: Peer, cancel: ActionCancel) -> None:
        """Pass on what the seat's holder or a supervisor cancels. Others have STOP."""
        if peer.role == "supervisor" or self._holds_seat(peer):
            self.cancel(cancel.id, peer.actor)

    async def cancel_by_http(self, by: Actor, id: str) -> ActionUpdate:
        """Cancel an action; return how it ended, also if that was before. The caller has checked the right to.

        Raises:
            NotFound: no action of this id is known.
            TooManyRequests: of this link.
            RobotLinkDown, Unconfirmed: the robot cannot be told, or the action has not ended yet.
        """
        _spend(self._cancels, by, "cancellations")
        kept = next((each for each in self.newest() if each.id == id), None)
        known = kept or self._requests.newest(id, time.monotonic())  # those are remembered longer
        if known is None and id not in self._requests:
            raise NotFound(f"no action {id!r} is known here"[:200])
        if known is not None and known.state != "running":
            return known
        if not self._robot.up:
            raise RobotLinkDown(self._robot.detail)
        self.cancel(id, by)
        return await self._ends.wait(id)

    def cancel(self, id: str, by: Actor) -> None:
        """Cancel an action; "" cancels the one that moves the robot. `Actor()`: because the seat changes hands."""
        if any(each.state == "running" and (each.id == id or (not id and each.moves)) for each in self.newest()):
            self._robot.send(ActionCancel(id=id))
            self._events.publish(ActionCancelled(by, id))
        elif id:
            self._robot.send(ActionCancel(id=id))  # its first update may be on the way

    def renews(self, id: str) -> bool:
        """True if a command that names `id` lets an action go on that moves the robot."""
        update = self._kept.get(id)
        return update is not None and update.moves and update.state == "running"

    def updated(self, update: ActionUpdate) -> None:
        """Take the robot's news of an action."""
        now, before = time.monotonic(), self._kept.get(update.id)
        if msgspec.structs.replace(update, age=0.0) == before:
            return
        self._requests.updated(update, now)
        self._ends.updated(update)
        if before is not None and before.state == update.state:
            if self._kept.owes(update.id):
                self._kept.keep(update, now)
            elif self._progress.take(now):
                self._kept.keep(update, now)
                self._events.publish(ActionUpdated(update, new_state=False))
        elif not self._kept.is_owing and self._states.take(now):
            self._kept.keep(update, now)
            self._events.publish(ActionUpdated(update, new_state=True))
        else:
            self._events.publish(InputRefused("robot", "too_many_action_states"))
            if before is not None or update.id in self._requests:  # else it is one that nobody here has asked for
                self._kept.owe(update, now)
                self._is_owing.set()

    async def run(self) -> None:
        """Tell the states that came too fast, the newest of each action, until cancelled."""
        while True:
            await self._is_owing.wait()
            await asyncio.sleep(self._states.wait(time.monotonic()))
            now = time.monotonic()
            while self._kept.is_owing and self._states.take(now):
                self._events.publish(ActionUpdated(self._kept.take_owed(now), new_state=True))
            if not self._kept.is_owing:
                self._is_owing.clear()

    def robot_link_down(self) -> None:
        """Note what the bridge does without this link: it cancels the action that moves the robot."""
        for update in self.newest():
            if update.moves and update.state == "running":
                self.updated(msgspec.structs.replace(update, state="cancelled", reason="link_down"))

    def epoch_ends(self) -> None:
        """Forget all actions and requests: the bridge that did them has ended, and the next one knows none of them."""
        self._requests.clear()
        self._ends.clear()
        self._kept.clear()


def _spend(limits: RateLimits, by: Actor, what: str) -> None:
    """Count a request of a link. Raises TooManyRequests."""
    if not limits.spend(by.link or by.name, time.monotonic()):
        raise TooManyRequests(f"at most five {what} a second")
