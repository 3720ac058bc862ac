"""Cases about goal axes: where the applied goal goes, and where it does not."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Feedback, Rest
from lockstep.protocol.neutral import has_goals
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.driver import Driver
from lockstep.robot_bridge.conformance.errors import NotApplicable, expect
from lockstep.robot_bridge.conformance.subject import Subject, needs
from lockstep.robot_bridge.conformance.waiting import PATIENCE, within

__all__ = ["GOAL_CASES"]

SECTION = "Goal axes"
ENGAGEMENTS = 5
SAME = 1e-6  # of the reach: a goal that differs by less stands still
SLOW = 0.5  # s that a motion takes which is slowed by `speed`
ARRIVAL = 10.0  # s in which a goal near by has to be reached
LATE = 0.5  # s after `hold` until the goal is looked at


class _Goal:
    """The first goal axis that can be driven, and its number."""

    def __init__(self, driver: Driver) -> None:
        for number, axis in enumerate(driver.description.axes):
            if axis.kind == "goal" and axis.minimum < axis.maximum and driver.feedback.goals[number] is not None:
                self.number, self.axis, self._driver = number, axis, driver
                return
        raise NotApplicable("no goal axis of this robot has a known place")

    @property
    def place(self) -> float:
        """The applied goal in the newest feedback."""
        return place_in(self._driver.feedback, self.number, self.axis)

    def command(self, goal: float) -> list[float | None]:
        """Return a command's values with this goal, and everything else at rest."""
        values = self._driver.neutral
        values[self.number] = goal
        return values

    def near(self) -> float:
        """Return a goal a small way away."""
        return self._driver.motion.next_goal(self.axis, self.place)

    def is_at(self, goal: float) -> bool:
        return abs(self.place - goal) <= SAME * self.axis.reach


def place_in(feedback: Feedback, number: int, axis: Axis) -> float:
    goal = feedback.goals[number]
    if goal is None:
        raise NotApplicable(f"the place of {axis.name} is not known any more")
    return goal


@asynccontextmanager
async def _engaged(subject: Subject, *, armed: bool = True) -> AsyncIterator[tuple[Driver, _Goal]]:
    async with subject.operator(armed=armed) as driver:
        needs(has_goals(driver.description.axes), "the description has no goal axes")
        yield driver, _Goal(driver)


async def _in_feedback(subject: Subject) -> None:
    async with subject.operator() as driver:
        needs(has_goals(driver.description.axes), "the description has no goal axes")
        feedback = await driver.drive(driver.neutral)
        for axis, goal in zip(driver.description.axes, feedback.goals, strict=True):
            known = axis.name in feedback.unknown or goal is not None
            expect(axis.kind == "rate" or known, f"goals has nothing for the goal axis {axis.name}")


async def _neutral(subject: Subject) -> None:
    async with _engaged(subject, armed=False) as (driver, goal):
        await driver.refused(driver.command(goal.command(goal.place)), "not_neutral")
        await driver.arm()
        await driver.drive(goal.command(goal.place))
        for number, axis in enumerate(driver.description.axes):
            if axis.kind == "rate":
                values = driver.neutral
                values[number] = None
                await driver.refused(driver.command(values), "not_a_number")


async def _engages(subject: Subject) -> None:
    async with _engaged(subject) as (driver, goal):
        began = goal.place
        for _ in range(ENGAGEMENTS):
            await driver.drive(goal.command(goal.place))
            driver.peer.send(Rest(event=driver.feedback.event))
            await driver.drive(driver.neutral)
        moved = goal.place - began
        expect(goal.is_at(began), f"{ENGAGEMENTS} engagements where it is moved {goal.axis.name} by {moved:g}")


async def _reached(subject: Subject) -> None:
    async with _engaged(subject) as (driver, goal):
        target, began = goal.near(), goal.place
        async with within(ARRIVAL, f"{goal.axis.name} does not get from {began:g} to {target:g}"):
            while not goal.is_at(target):
                await driver.drive(goal.command(target))
                beyond = (goal.place - target) * (1 if target > began else -1)
                expect(beyond <= SAME * goal.axis.reach, f"{goal.axis.name} overshoots its goal by {beyond:g}")
                needs(not driver.feedback.limits, "a limit keeps the axis from moving")


async def _speed(subject: Subject) -> None:
    async with _engaged(subject) as (driver, goal):
        target, began = goal.near(), goal.place
        share = min(1.0, abs(target - began) / goal.axis.slew / SLOW)
        began_at = (await driver.drive(goal.command(target), 0.0)).time
        while driver.feedback.time - began_at < SLOW / 2:
            await driver.drive(goal.command(target), 0.0)
        expect(goal.is_at(began), f"{goal.axis.name} moves while speed is 0")
        needs(share < 1.0, f"{goal.axis.name} is so slow that speed makes no difference")
        started = driver.feedback.time
        while driver.feedback.time - started < SLOW / 2:
            await driver.drive(goal.command(target), share)
        most = share * goal.axis.slew * (driver.feedback.time - started) * 1.5 + SAME
        moved = abs(goal.place - began)
        expect(
            moved <= most, f"{goal.axis.name} moved {moved:g} where speed {share:.3f} allows {most:g} with a reserve"
        )


async def _hold(subject: Subject) -> None:
    async with _engaged(subject) as (driver, goal):
        hold, target, began = driver.description.hold, goal.near(), goal.place
        share = min(1.0, abs(target - began) / goal.axis.slew / (3 * hold))
        moved = await driver.drive(goal.command(target), share)
        after = moved.time + hold + LATE
        await driver.heard(lambda feedback: feedback.time > after, "the passing of hold", hold + LATE + PATIENCE)
        stood = goal.place
        await driver.fresh()
        expect(goal.is_at(stood), f"{goal.axis.name} still moves {LATE} s after hold")
        needs(share < 1.0, f"{goal.axis.name} is so slow that one command cannot bring it there")
        expect(not goal.is_at(target), f"{goal.axis.name} went all the way, and hold had passed before")


async def _jump(subject: Subject) -> None:
    async with _engaged(subject) as (driver, goal):
        axis, event = goal.axis, driver.feedback.event
        way = 1.5 * axis.reach if axis.wrap is None else (axis.reach + axis.wrap / 2) / 2
        needs(way > axis.reach, f"{axis.name} reaches every place")
        began, measured = goal.place, driver.feedback.axes[goal.number]
        for far in (measured + way, measured - way):
            await driver.refused(driver.command(goal.command(far)), "jump")
        expect(driver.feedback.event == event, "a refused jump used up its event")
        await driver.drive(driver.neutral)
        expect(goal.is_at(began), f"a refused jump moved {axis.name}")


async def _wrap(subject: Subject) -> None:
    async with _engaged(subject) as (driver, _):
        for number, axis in enumerate(driver.description.axes):
            if axis.wrap is not None and driver.feedback.goals[number] is not None:
                began = place_in(driver.feedback, number, axis)
                for turns in (1, -2):
                    values = driver.neutral
                    values[number] = began + turns * axis.wrap
                    await driver.drive(values)
                    moved = place_in(driver.feedback, number, axis) - began
                    way = moved - axis.wrap * round(moved / axis.wrap)
                    expect(abs(way) <= SAME * axis.reach, f"{axis.name} turns although it is there already")
                return
        raise NotApplicable("no axis of this robot turns on and on")


async def _conflict(subject: Subject) -> None:
    async with _engaged(subject) as (driver, _):
        index = {axis.name: number for number, axis in enumerate(driver.description.axes)}
        for pose in driver.description.poses:
            own = [index[name] for name in (*pose.position, *pose.rotation) if name]
            for other in (index[name] for name in pose.instead_of):
                values = driver.neutral
                values[own[0]], values[other] = driver.feedback.goals[own[0]], driver.feedback.goals[other]
                if values[own[0]] is not None and values[other] is not None:
                    await driver.refused(driver.command(values), "conflict")
                    return
        raise NotApplicable("no pose of this robot stands in for other axes")


GOAL_CASES: tuple[Case, ...] = (
    Case("goals_in_feedback", "feedback has the applied goal of each goal axis", SECTION, _in_feedback),
    Case("goal_neutral", "null is neutral for a goal axis and no number for a rate axis", SECTION, _neutral),
    Case("goal_engage", "a goal where the axis is moves nothing, however often", "The clutch", _engages),
    Case("goal_reached", "the applied goal reaches the commanded one and does not overshoot", SECTION, _reached),
    Case("goal_speed", "speed bounds the speed of a goal", SECTION, _speed),
    Case("goal_hold", "without another command the goal stands still when hold has passed", SECTION, _hold),
    Case("goal_jump", "a goal beyond reach is refused, and its event is not used up", SECTION, _jump),
    Case("goal_wrap", "values that differ by the period are the same place", SECTION, _wrap),
    Case("goal_conflict", "a pose and the axes that it stands in for are not driven at once", SECTION, _conflict),
)
