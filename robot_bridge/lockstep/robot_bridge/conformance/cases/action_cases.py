"""Cases about actions: at most once, and no motion without armed events. A robot without actions has nothing to try."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from itertools import count

import msgspec

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.description import Action
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.driver import BY, Driver
from lockstep.robot_bridge.conformance.errors import expect
from lockstep.robot_bridge.conformance.subject import Subject, needs
from lockstep.robot_bridge.conformance.waiting import PATIENCE, SETTLE, within

__all__ = ["ACTION_CASES"]

HOLDS = 2  # times `hold` for which an action is renewed, beyond what it might wait for a renewal
LONGEST_WAIT = 2.0  # s for which an action may wait to be renewed
TRIES = 5  # attempts where a busy machine holds up this program or the bridge
HELD_UP = 1.5  # times `hold`: a motion that ended unrenewed so late is tried again
ASKING = ("late", "too_often", "not_possible", "busy")  # refusals after which a case cannot be tried

_ids = count(1)


def _moving(driver: Driver) -> Action:
    """Return an action that moves the robot and needs no person: no question, and no value without a default.

    Raises:
        NotApplicable: there is none.
    """
    for action in driver.description.actions:
        if action.moves and not action.confirm and all(each.default is not None for each in action.parameters):
            return action
    needs(False, "no action that moves the robot can be begun without a person")
    raise AssertionError("`needs` raises")


def _request(driver: Driver, name: str, *, nonce: int | None = None) -> Act:
    nonce = driver.feedback.nonce if nonce is None else nonce
    return Act(id=f"check-{next(_ids)}-{nonce:x}"[:64], name=name, nonce=nonce, by=BY)


async def _told(driver: Driver, id: str, patience: float = PATIENCE) -> ActionUpdate:
    """Return the next update of this request."""
    async with within(patience, f"no `action` message tells of request {id}"):
        while True:
            said = driver.passed_over.popleft() if driver.passed_over else await driver.next()
            if isinstance(said, ActionUpdate) and said.id == id:
                return said


async def _refused(driver: Driver, act: Act, reason: str) -> None:
    driver.peer.send(act)
    said = await _told(driver, act.id)
    expect(
        (said.state, said.reason) == ("refused", reason),
        f"an action that must be refused {reason!r} is {said.state} {said.reason}".rstrip(),
    )


async def _begun(driver: Driver) -> Act:
    """Begin an action that moves the robot."""
    act = _request(driver, _moving(driver).name)
    driver.peer.send(act)
    said = await _told(driver, act.id)
    needs(not (said.state == "refused" and said.reason in ASKING), f"the robot refuses it: {said.reason} {said.text}")
    expect(said.state == "running", f"a proper request is {said.state} {said.reason}".rstrip())
    expect(said.moves, "an action that moves the robot says that it does not")
    return act


async def _ended(driver: Driver, act: Act, *reasons: str) -> str:
    """Wait until a motion is cancelled, for one of these reasons; return it."""
    longest, began = driver.description.hold + SETTLE, driver.feedback.time
    async with within(longest + PATIENCE, f"the action goes on; it had to end: {' or '.join(reasons)}"):
        while (said := await _told(driver, act.id, longest + PATIENCE)).state == "running":
            pass
    if said.state == "cancelled":
        expect(said.reason in reasons, f"cancelled {said.reason!r}, not {' or '.join(map(repr, reasons))}")
    else:
        took = driver.feedback.time - began
        expect(took <= longest, f"the action went on for {took:.1f} s; it had to end: {' or '.join(reasons)}")
        needs(False, f"the action was {said.state} before it had to be cancelled")
    return said.reason


async def _interrupted(driver: Driver, interrupt: Callable[[], Awaitable[object]], reason: str) -> None:
    """Begin a motion and interrupt it, which has to cancel it for this reason.

    Where a busy machine lets the motion end unrenewed before it is interrupted, it is tried again. Only a machine that
    held up this program each time is an excuse: a bridge that is late each time is wrong.
    """
    loop, hold = asyncio.get_running_loop(), driver.description.hold
    is_ours = True
    for _ in range(TRIES):
        asked = loop.time()
        act = await _begun(driver)
        await interrupt()
        delay = loop.time() - asked
        found = await _ended(driver, act, reason, "not_renewed")
        if found == reason:
            return
        is_ours = is_ours and delay > hold / 2
        expect(is_ours or loop.time() - asked > HELD_UP * hold, f"cancelled {found!r}, not {reason!r}")
        await _calmed(driver)
    expect(is_ours, f"cancelled {found!r} {TRIES} times, not {reason!r}")
    needs(False, f"the machine is too busy: the motion ended unrenewed before it was {reason}")


async def _calmed(driver: Driver) -> None:
    """Bring the robot to where an action can begin."""
    await driver.fresh()
    if driver.feedback.stop.stopped:
        await driver.reset()
    await driver.drive(driver.neutral)
    await driver.heard(lambda feedback: feedback.at_rest, "at rest after an action")


async def _unknown(subject: Subject) -> None:
    async with subject.operator() as driver:
        needs(bool(driver.description.actions), "the description has no actions")
        await _refused(driver, _request(driver, "no such action"), "unknown_action")


async def _late(subject: Subject) -> None:
    async with subject.operator() as driver:
        name = _moving(driver).name
        await _refused(driver, _request(driver, name, nonce=driver.feedback.nonce % 2**52 + 1), "late")


async def _neutral(subject: Subject) -> None:
    async with subject.operator(armed=False) as driver:
        name = _moving(driver).name
        expect(driver.feedback.neutral_needed, "neutral_needed is false on a new operator link")
        await _refused(driver, _request(driver, name), "not_neutral")


async def _stopped(subject: Subject) -> None:
    async with subject.operator() as driver:
        name = _moving(driver).name
        await driver.stop("check-action-stop")
        await driver.heard(lambda feedback: feedback.stop.stopped, "the stop")
        await _refused(driver, _request(driver, name), "stopped")


async def _hold(subject: Subject) -> None:
    async with subject.operator() as driver:
        act = await _begun(driver)
        began, hold = driver.feedback.time, driver.description.hold
        said = await _unrenewed(driver, act, began + hold + SETTLE)
        expect(driver.feedback.at_rest, f"the action goes on: the robot moves when it was not renewed for {hold:g} s")
        if said.state == "running":  # it may wait to be renewed, but not for ever
            said = await _unrenewed(driver, act, began + _longest_wait(driver) + SETTLE, rests=True)
        expect(said.state != "running", "the action goes on; it had to end: not_renewed")
        needs(said.state == "cancelled", f"the action was {said.state} before it had to be cancelled")
        expect(said.reason == "not_renewed", f"cancelled {said.reason!r}, not 'not_renewed'")
        driver.peer.send(act)
        said = await _told(driver, act.id)
        expect(said.state == "cancelled", f"a repeat of a request that was cancelled is {said.state}: it began again")


def _longest_wait(driver: Driver) -> float:
    """Return after how many s without a renewal an action has to be cancelled."""
    return max(driver.description.hold, LONGEST_WAIT)


async def _waiting(subject: Subject) -> None:
    async with subject.operator() as driver:

        def moving() -> Command:
            return driver.command(driver.moving())

        def rest() -> Rest:
            return Rest(event=event_after(driver.feedback.event))

        longest = driver.description.hold + SETTLE
        for reason, interrupt in (("driving", moving), ("rested", rest)):
            act = await _begun(driver)
            said = await _unrenewed(driver, act, driver.feedback.time + longest)
            needs(said.state == "running", "no action of the robot waits to be renewed")
            driver.peer.send(interrupt())
            said = await _unrenewed(driver, act, driver.feedback.time + longest)
            found = f"{said.state} {said.reason}".rstrip()
            expect(
                found == f"cancelled {reason}", f"an action that waits is {found}; it had to be cancelled {reason!r}"
            )
            await _calmed(driver)


async def _unrenewed(driver: Driver, act: Act, until: float, *, rests: bool = False) -> ActionUpdate:
    """Send neutral commands that name no action until the robot's clock says so; return what became of the action.

    `rests`: the robot has to be at rest all the while.
    """
    pause = 1 / driver.description.max_event_rate
    newest = ActionUpdate(id=act.id, name=act.name, state="running", event=driver.feedback.event)
    async with within(until - driver.feedback.time + PATIENCE, "neutral commands are not answered"):
        while driver.feedback.time < until:
            driver.peer.send(driver.command(driver.neutral))
            while not isinstance(said := await driver.next(), Feedback | Refusal):
                if isinstance(said, ActionUpdate) and said.id == act.id:
                    newest = said
            expect(
                driver.feedback.at_rest or not rests,
                "the action goes on: the robot moves again, and nothing renewed it",
            )
            await asyncio.sleep(pause)
    return newest


def _is_of(command: Command, feedback: Feedback) -> bool:
    return feedback.event == command.event


async def _renewed(subject: Subject) -> None:
    async with subject.operator() as driver:
        for _ in range(TRIES):
            said, is_held_up = await _kept_alive(driver)
            if said.state != "cancelled":
                return
            expect(is_held_up, f"an action that armed events renew was cancelled {said.reason!r}")
            await _calmed(driver)
        needs(False, "the machine is too busy: an action cannot be renewed within hold")


async def _kept_alive(driver: Driver) -> tuple[ActionUpdate, bool]:
    """Renew an action for a while. Return its state then, and whether something held up a renewal for `hold`."""
    loop, hold = asyncio.get_running_loop(), driver.description.hold
    renewed, longest = loop.time(), 0.0  # sent; from there until the next was surely there
    act = await _begun(driver)
    began = driver.feedback.time
    while driver.feedback.time - began < _longest_wait(driver) + HOLDS * hold:
        command = msgspec.structs.replace(driver.command(driver.neutral), action=act.id)
        sent = loop.time()
        driver.peer.send(command)
        await driver.heard(partial(_is_of, command), f"event {command.event}")
        renewed, longest = sent, max(longest, loop.time() - renewed)
    driver.peer.send(act)
    said = await _told(driver, act.id)
    return said, max(longest, loop.time() - renewed) >= hold


async def _stick(subject: Subject) -> None:
    async with subject.operator() as driver:

        async def move() -> None:
            driver.peer.send(driver.command(driver.moving()))

        await _interrupted(driver, move, "driving")


async def _rest(subject: Subject) -> None:
    async with subject.operator() as driver:

        async def rest() -> None:
            driver.peer.send(Rest(event=event_after(driver.feedback.event)))

        await _interrupted(driver, rest, "rested")


async def _stop(subject: Subject) -> None:
    async with subject.operator() as driver:
        await _interrupted(driver, lambda: driver.stop(f"check-action-{next(_ids)}"), "stopped")


ACTION_CASES: tuple[Case, ...] = (
    Case("action_unknown", "an action that the robot does not have is refused unknown_action", "Actions", _unknown),
    Case("action_late", "a request that names no nonce of a recent feedback is refused late", "Actions", _late),
    Case("action_neutral", "a motion is refused not_neutral on a new operator link", "What moves the robot", _neutral),
    Case("action_stopped", "a stopped robot begins no action", "What moves the robot", _stopped),
    Case(
        "action_hold",
        "a motion that no armed event renews is cancelled when hold has passed, and a repeat does not begin it again",
        "What moves the robot",
        _hold,
    ),
    Case("action_waits", "a moving command and a rest cancel a motion that waits", "What moves the robot", _waiting),
    Case("action_renewed", "a motion goes on while armed events name it", "What moves the robot", _renewed),
    Case("action_stick", "a moving command cancels a motion", "What moves the robot", _stick),
    Case("action_rest", "a rest cancels a motion", "What moves the robot", _rest),
    Case("action_stop", "a stop cancels a motion", "What moves the robot", _stop),
)
