"""Measures the time from sending a command to its feedback, with the headless client on loopback.

Each command is sent when the gate is open, so the event rate's limit is no part of the figure; it is the time that a
script sees from calling `drive` to its return. The bridge's own log has, on the same monotonic clock, the times at
which it executed the event and issued the feedback: the wait for the control tick, the tick and the measurement. That
is taken off event by event; the rest is the console's own share: client, data channel, server, robot link, and back.
The baseline is the robot link alone: the same robot, driven the same way over TCP without a console between.
"""

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import Trip, console_trips, link_trips
from lockstep.bench.harness.event_log import robot_times
from lockstep.bench.harness.stack import Bridge, running_bridge, running_stack
from lockstep.client import Console
from lockstep.robot_bridge.link.link_client import RobotLink

__all__ = ["run"]

SECTION = "command_to_feedback"
EVENTS, QUICK_EVENTS = 600, 60
LINK = "the robot link alone, without a console"
MEDIAN_MS, P99_MS, OWN_MEDIAN_MS = 8.0, 20.0, 1.0


async def run(context: Context) -> list[Result]:
    count = context.scale(EVENTS, QUICK_EVENTS)
    results: list[Result] = []
    for robot in context.robots:
        direct = await _direct(robot, count // 2)
        results += _compare(robot, await _through_console(robot, count), direct)
    return results


class _Measured:
    """Trips in ms, and the part of each that is not the robot's."""

    def __init__(self, trips: list[Trip], bridge: Bridge) -> None:
        robot = robot_times(bridge.event_log)
        known = [trip for trip in trips if trip.event in robot]
        self.total = [trip.seconds * 1000 for trip in known]
        self.own = [(trip.seconds - robot[trip.event]) * 1000 for trip in known]


async def _direct(robot: str, count: int) -> _Measured:
    async with running_bridge(robot) as bridge:
        async with RobotLink("127.0.0.1", bridge.port, "operator", name="bench") as link:
            description = link.hello.description
            if description is None:
                raise RuntimeError("the bridge did not describe its robot")
            trips = await link_trips(link, description, count)
        return _Measured(trips, bridge)


async def _through_console(robot: str, count: int) -> _Measured:
    async with running_stack(robot) as stack:
        async with Console(stack.operator, name="bench") as console:
            await console.take_seat()
            await console_trips(console, 10)  # the first events also start the robot's and the codecs' machinery
            trips = await console_trips(console, count)
        return _Measured(trips, stack.bridge)


def _compare(robot: str, ours: _Measured, direct: _Measured) -> list[Result]:
    def row(name: str, value: float, baseline: float, target: float | None) -> Result:
        return Result(
            section=SECTION,
            name=f"{robot}: {name}",
            value=value,
            unit="ms",
            target=target,
            baseline=baseline,
            baseline_name=LINK,
            samples=len(ours.total),
            conditions="pictures of all cameras and sound received and decoded by the client meanwhile",
        )

    return [
        row("median", median(ours.total), median(direct.total), MEDIAN_MS),
        row("p99", quantile(ours.total, 0.99), quantile(direct.total, 0.99), P99_MS),
        row("console's own share, median", median(ours.own), median(direct.own), OWN_MEDIAN_MS),
        row("console's own share, p99", quantile(ours.own, 0.99), quantile(direct.own, 0.99), None),
    ]
