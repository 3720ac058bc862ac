"""Cases about coming to rest: hold, rest, lost links, and what comes before the first motion."""

from lockstep.protocol.messages import Rest
from lockstep.protocol.serial import MAX_EVENT, event_after
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.errors import expect
from lockstep.robot_bridge.conformance.subject import Subject, needs
from lockstep.robot_bridge.conformance.waiting import PATIENCE

__all__ = ["REST_CASES"]

MOTIONS = 5  # commands in which a robot shows that it moves
FAR_AHEAD = 500  # events


async def _moves(subject: Subject) -> None:
    async with subject.operator() as driver:
        values = driver.moving()
        for _ in range(MOTIONS):
            if not (await driver.drive(values)).at_rest:
                return
        held = driver.feedback.limits
        needs(not held, f"a limit keeps the robot from moving: {', '.join(held)}")
        expect(False, "at_rest stays true while a moving command is executed")


async def _hold(subject: Subject) -> None:
    async with subject.operator() as driver:
        moved = await driver.drive(driver.moving())
        longest = driver.description.hold + subject.settle
        stood = await driver.heard(
            lambda feedback: (feedback.at_rest and feedback.issue > 1) or feedback.time - moved.time > longest,
            "the passing of hold",
            longest + PATIENCE,
        )
        expect(stood.event == moved.event, "the event changed, and nothing was commanded")
        expect(stood.at_rest, f"not at rest {stood.time - moved.time:.1f} s after the last command")


async def _rest(subject: Subject) -> None:
    async with subject.operator() as driver:
        await driver.drive(driver.moving())
        driver.peer.send(Rest(event=event_after(driver.feedback.event)))
        await driver.refused(driver.command(driver.moving()), "rested")
        await driver.heard(lambda feedback: feedback.at_rest, "at rest after a rest")
        await driver.drive(driver.neutral)
        await driver.drive(driver.moving())


async def _rest_past(subject: Subject) -> None:
    async with subject.operator() as driver:
        before = driver.feedback.event
        values = driver.moving()
        await driver.drive(values)
        driver.peer.send(Rest(event=before))
        await driver.drive(values)


async def _rest_ahead(subject: Subject) -> None:
    async with subject.operator() as driver:
        event = driver.feedback.event
        driver.peer.send(Rest(event=event + FAR_AHEAD if event + FAR_AHEAD <= MAX_EVENT else FAR_AHEAD))
        await driver.refused(driver.command(driver.moving()), "rested")
        await driver.drive(driver.neutral)
        await driver.drive(driver.moving())


async def _lost_link(subject: Subject) -> None:
    async with subject.operator() as driver:
        event = (await driver.drive(driver.moving())).event
        driver.peer.cut()
    async with subject.operator(armed=False) as driver:
        expect(driver.feedback.event == event, f"event {driver.feedback.event} on a new link, and not {event}")
        longest = driver.description.hold + subject.settle
        await driver.heard(
            lambda feedback: feedback.at_rest, "at rest after the operator link broke", longest + PATIENCE
        )


async def _new_link(subject: Subject) -> None:
    async with subject.operator(armed=False) as driver:
        expect(driver.feedback.neutral_needed, "neutral_needed is false on a new operator link")
        await driver.refused(driver.command(driver.moving()), "not_neutral")
        await driver.arm()
        await driver.drive(driver.moving())


async def _warning(subject: Subject) -> None:
    async with subject.operator(armed=False) as driver:
        needs(driver.description.start_warning is not None, "the description has no start_warning")
        await driver.drive(driver.neutral)
        expect(driver.feedback.warning > 0, "no warning after the neutral command")
        await driver.refused(driver.command(driver.moving()), "warning")
        await driver.arm()
        await driver.drive(driver.moving())


REST_CASES: tuple[Case, ...] = (
    Case(
        "new_link",
        "on a new operator link a neutral command comes before the first motion",
        "Before the first motion",
        _new_link,
    ),
    Case("moves", "at_rest is false while the robot moves", "feedback, bridge to operator", _moves),
    Case("hold", "without another command the robot is at rest when hold has passed", "Hold", _hold),
    Case("rest", "a rest voids moving commands up to its event, and neutral ones pass", "Rest", _rest),
    Case("rest_past", "a rest for an event that is past does nothing", "Rest", _rest_past),
    Case("rest_ahead", "a rest for a far event voids only the next one", "Rest", _rest_ahead),
    Case(
        "lost_link",
        "a robot whose operator link breaks comes to rest, and takes the next operator",
        "Lost links",
        _lost_link,
    ),
    Case("warning", "moving commands are refused while the robot warns", "Before the first motion", _warning),
)
