"""A serial chain of joints: where its tool is, and how each joint moves it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Body
from lockstep.robot_bridge.kinematics.rotations import from_quaternion

__all__ = ["Chain", "ChainPoint", "ChainState", "NoChain", "cross"]

Array = npt.NDArray[np.float64]
PARALLEL = 1e-9  # of 1 - cosine


class NoChain(ValueError):
    """The bodies hold no such chain. The text says why."""


class ChainPoint(NamedTuple):
    """A point of a body of the chain."""

    moving: int  # number of joints, from the base on, that move it
    position: Array  # m, in the frame that the last of them moves


class ChainState(NamedTuple):
    """The chain at some joint positions, in the frame of its base."""

    position: Array  # m, of the tool
    rotation: Array  # 3 x 3, of the tool
    linear: Array  # m/s of the tool per rad/s (or m/s) of each joint, 3 x joints
    angular: Array  # rad/s of the tool per rad/s (or m/s) of each joint, 3 x joints
    places: Array  # m, of each joint's moving frame, after the base's own: (joints + 1) x 3
    turns: Array  # of the same frames: (joints + 1) x 3 x 3
    axes: Array  # unit vectors of the joints, joints x 3


class _Link(NamedTuple):
    offset: Array  # m, from the frame before, in that frame
    turn: Array  # 3 x 3, of this frame against the frame before, at joint position zero
    axis: Array  # unit vector in its own frame
    slides: bool


class Chain:
    """Computes forward kinematics and the geometric Jacobian from the bodies of a description.

    Attributes:
        joints: names of the joints, from the base to the tool
        begins: m, where the first joint is, in the base's frame
        length: m, of the way from the first joint to the tool along the bodies, with every slide at zero
    """

    def __init__(
        self, bodies: Sequence[Body], tool: str, base: str = "", point: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> None:
        """`tool`: a body. `base`: the body in whose frame poses are; "": the world. `point`: m, in the tool's frame.

        Raises:
            NoChain: the tool does not hang on the base by joints.
        """
        path = _path(bodies, tool, base)
        self.joints = tuple(joint.joint for body in path for joint in body.joints)
        if not self.joints or len(set(self.joints)) < len(self.joints):
            raise NoChain(f"between {base or 'the world'} and {tool} are no joints, or the same one twice")
        self._links: list[_Link] = []
        self._bodies: dict[str, tuple[int, Array, Array]] = {base: (0, np.zeros(3), np.eye(3))}
        offset, turn = np.zeros(3), np.eye(3)  # since the last joint
        for body in path:
            offset = offset + turn @ np.array(body.position)
            turn = turn @ from_quaternion(body.orientation)
            for joint in body.joints:
                axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
                self._links.append(_Link(offset, turn, axis, joint.kind == "prismatic"))
                offset, turn = np.zeros(3), np.eye(3)
            self._bodies[body.name] = (len(self._links), offset, turn)
        end = offset + turn @ np.array(point)
        self._end = _frame(turn, end)
        self._slides = np.array([link.slides for link in self._links])
        self._axes = np.array([link.axis for link in self._links])[:, :, None]  # columns, in the frames that they move
        self._parts = np.array([_parts(link) for link in self._links]).swapaxes(0, 1)
        self._has_slides = bool(self._slides.any())
        self.begins: Array = self._links[0].offset
        self.length = sum(math.hypot(*link.offset) for link in self._links[1:]) + math.hypot(*end)

    def has(self, body: str) -> bool:
        """Return whether a body is between the base and the tool, these included."""
        return body in self._bodies

    def point(self, body: str, position: Sequence[float]) -> ChainPoint:
        """Return a point of a body of the chain; `position`: m, in the body's frame.

        Raises:
            NoChain: the body is not between the base and the tool.
        """
        if body not in self._bodies:
            raise NoChain(f"{body} is not a part of the chain")
        moving, offset, turn = self._bodies[body]
        return ChainPoint(moving, offset + turn @ np.array(position))

    def at(self, joints: Sequence[float]) -> ChainState:
        """Return the state at these joint positions (rad or m), in the order of `joints`."""
        values = np.array(joints, dtype=np.float64)
        if len(values) != len(self._links):
            raise ValueError(f"{len(values)} positions for {len(self._links)} joints")
        values = values[:, None, None]
        fixed, sine, cosine, slide = self._parts
        steps = fixed + np.sin(values) * sine + np.cos(values) * cosine + values * slide
        frames = np.empty((len(steps) + 1, 4, 4))
        frames[0] = np.eye(4)
        for number, step in enumerate(steps):
            np.matmul(frames[number], step, out=frames[number + 1])
        tool = frames[-1] @ self._end
        places, turns = frames[:, :3, 3], frames[:, :3, :3]
        axes = (turns[1:] @ self._axes)[:, :, 0]
        position = tool[:3, 3]
        linear, angular = cross(axes, position - places[1:]), axes
        if self._has_slides:
            linear = np.where(self._slides[:, None], axes, linear)
            angular = np.where(self._slides[:, None], 0.0, axes)
        return ChainState(position, tool[:3, :3], linear.T, angular.T, places, turns, axes)

    def levers(self, near: int, far: int, extent: float) -> Array:
        """Return how fast the distance of two bodies changes at most when each joint does, m per rad.

        `near`, `far`: the number of joints that move each, the smaller first; the base is moved by none. `extent`: m,
        how far points of the second are from the origin of the frame that its last joint moves. Infinite where a slide
        is between them: its length bounds nothing.
        """
        levers = np.zeros(len(self._links))
        for joint in range(near, far):
            between = self._links[joint + 1 : far]
            slides = self._links[joint].slides or any(link.slides for link in between)
            levers[joint] = math.inf if slides else sum(math.hypot(*link.offset) for link in between) + extent
        return levers

    def turns_about(self, direction: Array) -> bool:
        """Return whether the first joint turns about this unit vector, in the base's frame, or against it."""
        first = self._links[0]
        return not first.slides and abs(float(first.turn @ first.axis @ direction)) > 1.0 - PARALLEL

    def place(self, state: ChainState, point: ChainPoint) -> Array:
        """Return where a point is, m."""
        return state.places[point.moving] + state.turns[point.moving] @ point.position  # type: ignore[no-any-return]

    def motion(self, state: ChainState, moving: int, place: Array) -> Array:
        """Return the velocity of a point per velocity of each joint, 3 x joints; `moving`: as of its `ChainPoint`."""
        columns = np.zeros((len(self._links), 3))
        columns[:moving] = cross(state.axes[:moving], place - state.places[1 : moving + 1])
        if self._has_slides:
            slides = self._slides[:moving]
            columns[:moving][slides] = state.axes[:moving][slides]
        return columns.T

    def twists(self, state: ChainState, motion: Array) -> tuple[Array, Array]:
        """Return how each moving frame moves when the joints do, the base's own first: (joints + 1) x 3 each.

        The first is the motion of the point of the frame that is at the origin now, m; the second its turn, rad. So a
        point of the frame at `place` moves by the first plus the second x `place`. `motion`: rad or m, of each joint.
        """
        along = state.axes * motion[:, None]
        turns = np.where(self._slides[:, None], 0.0, along) if self._has_slides else along
        ways = cross(state.places[1:], turns)
        if self._has_slides:
            ways[self._slides] = along[self._slides]
        none = np.zeros((1, 3))
        return np.concatenate((none, ways.cumsum(axis=0))), np.concatenate((none, turns.cumsum(axis=0)))


def _frame(turn: Array, offset: Array) -> Array:
    """Return the homogeneous matrix, 4 x 4, of a turn (3 x 3) and then an offset (m)."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = turn, offset
    return frame


def _parts(link: _Link) -> list[Array]:
    """Return what a joint's frame is against the frame before it: four matrices 4 x 4, of which they are the sum.

    The first stands alone, the others are multiplied by the sine and the cosine of the joint's position (Rodrigues'
    formula), and by the position.
    """
    fixed, sine, cosine, slide = _frame(link.turn, link.offset), np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    if link.slides:
        slide[:3, 3] = link.turn @ link.axis
        return [fixed, sine, cosine, slide]
    x, y, z = link.axis
    about = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    sine[:3, :3] = link.turn @ about
    cosine[:3, :3] = -link.turn @ about @ about
    fixed[:3, :3] -= cosine[:3, :3]
    return [fixed, sine, cosine, slide]


# Taken by index arrays: a tenth of the time that `numpy.cross` takes for so few rows.
FROM_SECOND, FROM_THIRD = np.array((1, 2, 0)), np.array((2, 0, 1))


def cross(one: Array, other: Array) -> Array:
    """Return the cross products of rows."""
    products: Array = one.take(FROM_SECOND, 1) * other.take(FROM_THIRD, 1)
    return products - one.take(FROM_THIRD, 1) * other.take(FROM_SECOND, 1)


def _path(bodies: Sequence[Body], tool: str, base: str) -> list[Body]:
    """Return the bodies from below the base to the tool."""
    known = {body.name: body for body in bodies}
    path: list[Body] = []
    name = tool
    while name != base:
        if name not in known or len(path) > len(known):
            raise NoChain(f"{tool} does not hang on {base or 'the world'}")
        path.insert(0, known[name])
        name = known[name].parent
    return path
