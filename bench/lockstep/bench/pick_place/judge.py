"""Reads the recording of a run: its refusals, and how far the goals moved from one feedback to the next."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.control.ticks.tick_loop import MAX_CATCH_UP
from lockstep.robot_bridge.robots.so101.controls import JOINT_AXES, RATES
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import FeedbackRecord, RefusalRecord, RobotRecord
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file

__all__ = ["Judged", "judge"]

# s of motion beside the time between two feedbacks. Goals move per tick, times are the machine's clock: before
# either feedback a busy machine may have held the bridge up, which then makes ticks good at once.
ROOM: Final = 2 * (MAX_CATCH_UP + 2) * 0.004


@dataclass
class Judged:
    """
    Attributes:
        verdict: of `lockstep verify`
        refusals: how often each reason
        step: the largest motion of a joint's goal between two feedbacks, as a share of what the joint's rate allows in
            that time; at most 1. The tool's own goals are read anew where the arm came to rest, which moves nothing.
        step_axis: whose that was
        events: number of commands that were executed
        seconds: of the robot's clock
    """

    verdict: Verdict
    refusals: Counter[str] = field(default_factory=Counter)
    step: float = 0.0
    step_axis: str = ""
    events: int = 0
    seconds: float = 0.0


def judge(path: Path) -> Judged:
    """Judge a recording of an SO-101.

    Raises:
        RecordingError: it is no recording.
    """
    found = Judged(verify_file(path))
    axes: tuple[Axis, ...] = ()
    feedbacks: list[FeedbackRecord] = []
    with RecordingReader(path) as reader:
        for number in range(len(reader.index.chunks)):
            for record in reader.chunk(number):
                own = own_record_of(record.schema, record.data)
                if isinstance(own, RobotRecord):
                    axes = own.description.axes
                elif isinstance(own, RefusalRecord):
                    found.refusals[own.reason] += 1
                elif isinstance(own, FeedbackRecord):
                    feedbacks.append(own)
    rates = {axis.name: rate for axis, rate in zip(JOINT_AXES, RATES, strict=True)}
    chosen = [(index, axis.name, rates[axis.name]) for index, axis in enumerate(axes) if axis.name in rates]
    for before, after in zip(feedbacks, feedbacks[1:], strict=False):
        found.events += after.event != before.event
        _compare(found, chosen, before, after)
    if feedbacks:
        found.seconds = feedbacks[-1].time - feedbacks[0].time
    return found


def _compare(
    found: Judged, joints: list[tuple[int, str, float]], before: FeedbackRecord, after: FeedbackRecord
) -> None:
    """`joints`: the number, name and rate (rad/s) of each."""
    seconds = after.time - before.time + ROOM
    for index, name, rate in joints:
        was, goal = before.goals[index], after.goals[index]
        if was is not None and goal is not None and abs(goal - was) / (rate * seconds) > found.step:
            found.step, found.step_axis = abs(goal - was) / (rate * seconds), name
