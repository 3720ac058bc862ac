"""A policy that goes along demonstrated paths to where the block lies now. It needs numpy alone."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.protocol.actions import StatusItem
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.kinematics.rotations import about_axis, from_rotation_vector, rotation_vector
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import StatusRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.event_rows import EventRow, event_rows
from lockstep.server.recording.reading.reader import RecordingReader

Array = npt.NDArray[np.float64]
Phase = Literal["approach", "carry", "leave"]

GRIPPER, TOOL = 5, slice(6, 12)  # axes of the robot
POSE: Final = ("tool.x", "tool.y", "tool.z", "tool.rx", "tool.ry", "tool.rz")
PHASES: Final[tuple[Phase, ...]] = ("approach", "carry", "leave")
APART: Final = 0.003  # m and, as 0.03 rad, a turn: between two points of a path. Where the arm rested is one point
STRAIGHT: Final = 0.06  # m of a path's end that are not bent: the fingers come from above
AHEAD: Final = 0.025  # m, from the tool to the point of the path that it is led to
THERE: Final = 0.006  # m
SETTLES: Final = 0.25  # s, at the end of a path and until the fingers have closed or opened
STUCK: Final = 8.0  # s of the robot's clock without a step on the path: it plans anew
MOVED: Final = 0.02  # m and rad, of the block: it plans anew
CLOSE: Final = 0.02  # rad, of the fingers' applied goal
IN_BOWL: Final = 0.04  # m, of the block from where it was let go
PAN: Final = 0.0388  # m, x of the axis about which the arm pans
QUARTER: Final = math.pi / 2


class Block(NamedTuple):
    x: float  # m
    y: float
    turn: float  # rad, about the vertical


class Demonstration(NamedTuple):
    """One kept episode. A path has rows of the tool's measured pose: m, m, m and a rotation vector, rad."""

    block: Block  # before the fingers closed
    paths: dict[Phase, Array]  # until the fingers close, until they open, and to the end
    fingers: dict[Phase, float]  # rad, where they were commanded to be
    holding: float  # rad, where the block kept them


def block_of(items: Sequence[StatusItem]) -> Block | None:
    """Return where the robot says that the block is."""
    said = {item.name: item.value for item in items}
    found = [said.get(name) for name in ("block_x", "block_y", "block_turn")]
    return None if None in found else Block(*map(float, found))  # type: ignore[arg-type]


def read_demonstrations(path: Path) -> list[Demonstration]:
    """Read the kept, successful episodes of a recording.

    Of an episode in which a policy drove, only what followed the first correction is read; without one, nothing.

    Raises:
        RecordingError, OSError: it cannot be read.
    """
    found = []
    with RecordingReader(path) as reader:
        rows, blocks = list(event_rows(reader)), list(_blocks(reader))
        for episode in reader.index.episodes:
            if episode.state != "kept" or episode.outcome != "success":
                continue
            of_it = [row for row in rows if episode.first_event < row.feedback.event <= episode.last_event]
            with_policy = any(row.driven_by.kind == "policy" for row in of_it)
            begins = [n for n, row in enumerate(of_it) if row.driven_by.intervention or not with_policy]
            if begins:
                found.append(_demonstration(of_it[begins[0] :], blocks))
    return [each for each in found if each is not None]


def _blocks(reader: RecordingReader) -> Iterator[tuple[int, Block]]:
    """Yield the block's places, each with its event."""
    for record in reader.records():
        if record.topic == OWN_TOPICS[StatusRecord]:
            own = own_record_of(record.schema, record.data)
            if isinstance(own, StatusRecord) and (block := block_of(own.items)) is not None:
                yield own.event, block


def _demonstration(rows: Sequence[EventRow], blocks: Sequence[tuple[int, Block]]) -> Demonstration | None:
    """Divide an episode where the fingers were commanded to close for the last time, and to open again."""
    poses = np.array([row.feedback.axes[TOOL] for row in rows])
    wanted = np.array([row.feedback.goals[GRIPPER] for row in rows], dtype=np.float64)
    measured = np.array([row.feedback.axes[GRIPPER] for row in rows])
    shut = wanted < (wanted.min() + wanted.max()) / 2
    closes, opens = np.flatnonzero(~shut[:-1] & shut[1:]) + 1, np.flatnonzero(shut[:-1] & ~shut[1:]) + 1
    if not len(closes) or not len(opens) or opens[-1] < closes[-1]:
        return None
    close, release = int(closes[-1]), int(opens[-1])
    begin = max((int(each) for each in opens if each < close), default=0)
    lay = [block for event, block in blocks if event <= rows[close].feedback.event]
    if not lay:
        return None
    return Demonstration(
        lay[-1],
        {
            "approach": thinned(poses[begin : close + 1]),
            "carry": thinned(poses[close : release + 1]),
            "leave": thinned(poses[release:]),
        },
        {"approach": float(wanted.max()), "carry": float(wanted.min()), "leave": float(wanted.max())},
        float(np.median(measured[close:release])),
    )


def thinned(path: Array) -> Array:
    """Return the points of a path that are apart, and its last."""
    kept = [path[0]]
    for pose in path[1:]:
        if np.abs((pose - kept[-1]) / (1, 1, 1, 10, 10, 10)).max() >= APART:
            kept.append(pose)
    kept[-1] = path[-1]
    return np.array(kept)


def to_go(path: Array) -> Array:
    """Return the way from each point of a path to its end, m."""
    steps = np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1)
    return np.append(np.cumsum(steps[::-1])[::-1], 0.0)


def moved(path: Array, was: Block, block: Block) -> Array:
    """Return the path to a block that lay there, as it leads to where it lies now."""
    turn = facing(block) - facing(was)
    rest = block.turn - was.turn - turn
    turn += (rest + QUARTER / 2) % QUARTER - QUARTER / 2  # a block looks the same after a quarter turn
    rotation = about_axis((0.0, 0.0, 1.0), turn)
    turned = [rotation_vector(rotation @ from_rotation_vector(pose[3:])) for pose in path]
    return np.hstack((path[:, :3] + (block.x - was.x, block.y - was.y, 0.0), turned))


def facing(block: Block) -> float:
    """Return where the block is as the arm sees it, rad, left of straight ahead."""
    return math.atan2(block.y, block.x - PAN)


def bent(path: Array, pose: Array) -> tuple[float, Array]:
    """Return the path from the point that is nearest to the tool on, so that it begins at the tool's pose.

    The number is how far its beginning was bent: m, and 0.1 m for each rad.
    """
    left = to_go(path)
    straight = min(STRAIGHT, left[0] / 2)
    may_begin = max(1, int(np.count_nonzero(left > straight + AHEAD)))
    distances = np.linalg.norm((path[:may_begin] - pose) * (1, 1, 1, 0.1, 0.1, 0.1), axis=1)
    begin = int(distances.argmin())
    share = np.clip((left[begin:] - straight) / max(left[begin] - straight, 1e-6), 0.0, 1.0)
    return float(distances[begin]), path[begin:] + share[:, np.newaxis] * (pose - path[begin])


class DemonstratedPaths:
    """Call `action` with each feedback.

    It takes the demonstrated path that has to be bent least from where the tool is, and follows it by what is measured.
    The fingers say which: when they hold something, that to the bowl, else that to the block.

    Attributes:
        phase: whose path it follows; None: it has to look
        done: it has opened the fingers over the bowl and gone up
    """

    def __init__(self, demonstrations: Sequence[Demonstration]) -> None:
        """Raises ValueError without a demonstration."""
        if not demonstrations:
            raise ValueError("there is nothing to learn from: no episode was kept as a success")
        self.demonstrations = list(demonstrations)
        self._fingers = {phase: float(np.median([each.fingers[phase] for each in demonstrations])) for phase in PHASES}
        holding = float(np.median([each.holding for each in demonstrations]))
        self._empty = (holding + self._fingers["carry"]) / 2  # rad: fingers that are nearer hold nothing
        self._bowl = np.median([each.paths["carry"][-1, :2] for each in demonstrations], axis=0)  # m
        self.begin()

    def begin(self) -> None:
        """Look where things are, as after a correction."""
        self.done = False
        self.phase: Phase | None = None
        self._path: Array | None = None  # None: the fingers close or open first, and the tool stays
        self._block = Block(0.0, 0.0, 0.0)  # that the path leads to
        self._at, self._since = 0, 0.0  # the point that the tool is led to; s of the robot's clock

    def action(self, feedback: Feedback, block: Block) -> dict[str, float]:
        """Return where the fingers and the tool are to be, by axis; an axis that is not named stays."""
        pose = np.array(feedback.axes[TOOL])
        if self.phase is None:
            self._enter(self._phase_of(feedback, block), feedback)
        elif self._path is not None:
            self._follow(self._path, pose, feedback, block)
        assert self.phase is not None
        fingers = self._fingers[self.phase]
        if self._path is None:
            if abs((feedback.goals[GRIPPER] or 0.0) - fingers) > CLOSE:
                self._since = feedback.time
            elif feedback.time - self._since >= SETTLES:
                self._plan(self.phase, pose, block, feedback.time)
        if self._path is None:
            return {"gripper": fingers}
        return {"gripper": fingers} | dict(zip(POSE, self._path[self._at].tolist(), strict=True))

    def _phase_of(self, feedback: Feedback, block: Block) -> Phase:
        if self._holds(feedback):
            return "carry"
        return "leave" if np.hypot(*(self._bowl - block[:2])) < IN_BOWL else "approach"

    def _holds(self, feedback: Feedback) -> bool:
        """Return whether the fingers, commanded to close, are kept apart."""
        shut = abs((feedback.goals[GRIPPER] or 0.0) - self._fingers["carry"]) < CLOSE
        return shut and feedback.axes[GRIPPER] > self._empty

    def _enter(self, phase: Phase, feedback: Feedback) -> None:
        self.phase, self._path, self._since = phase, None, feedback.time

    def _plan(self, phase: Phase, pose: Array, block: Block, now: float) -> None:
        paths = [
            bent(moved(each.paths[phase], each.block, block) if phase == "approach" else each.paths[phase], pose)
            for each in self.demonstrations
        ]
        self._path = min(paths, key=lambda found: found[0])[1]
        self._block, self._at, self._since = block, 0, now

    def _follow(self, path: Array, pose: Array, feedback: Feedback, block: Block) -> None:
        """Go on along the path; at its end to the next phase, and anew when the block is lost."""
        last = len(path) - 1
        distance = np.linalg.norm(path[:, :3] - pose[:3], axis=1)
        while self._at < last and distance[self._at] < AHEAD:
            self._at, self._since = self._at + 1, feedback.time
        there = self._at == last and distance[last] < THERE
        waited = feedback.time - self._since
        if self.phase == "carry" and not self._holds(feedback) or not there and waited > STUCK:
            self._enter("approach", feedback)
        elif self.phase == "approach" and np.abs(np.subtract(block, self._block)).max() > MOVED:
            self._plan(self.phase, pose, block, feedback.time)
        elif there and waited >= SETTLES and self.phase == "leave":
            self.done = True
        elif there and waited >= SETTLES:
            self._enter("carry" if self.phase == "approach" else "leave", feedback)
