"""The planar robot: a holonomic disc in a walled room, integrated by hand."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionDone, ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.microphone_source import MicrophoneSource
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow, PlanarPose
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION, FRONT, MICROPHONE, OVERVIEW, RADIUS, RANGES
from lockstep.robot_bridge.robots.planar.drawing import FrontDrawing, OverviewDrawing
from lockstep.robot_bridge.robots.planar.floor_map import has_room, make_map
from lockstep.robot_bridge.robots.planar.going import Going
from lockstep.robot_bridge.robots.planar.homing import Homing
from lockstep.robot_bridge.robots.planar.room import DOCK, contacts, ray_hits
from lockstep.robot_bridge.robots.planar.sound import Synthesiser
from lockstep.robot_bridge.robots.simulated_battery import SimulatedBattery

__all__ = ["PlanarRobot", "PlanarState"]

STIFFNESS = 150.0  # N per m/s that a contact blocks: the motors push harder the faster they should go
HOMING_SPEED = 0.4  # m/s
HOMING_TURN = 0.8  # rad/s
GOING_SPEED = 0.6  # m/s
CLEARANCE = 0.1  # m that `go_to` keeps from everything: the geofence's room to brake in, and some
LEAVING = 0.4  # m from where it begins, within which it may be nearer
TOUCHING = 0.02  # m
DOCKED = (0.05, 0.1)  # m and rad from the dock, within which the robot charges
HERE = (0.0, 0.0, 0.0)  # the measured pose is one on the map
ANGLES = RANGES.angle_min + RANGES.angle_increment * np.arange(RANGES.count, dtype=np.float64)


class PlanarState(NamedTuple):
    x: float = 0.0  # m
    y: float = 0.0  # m
    yaw: float = 0.0  # rad
    vx: float = 0.0  # m/s, in the robot's frame
    vy: float = 0.0  # m/s
    wz: float = 0.0  # rad/s
    fx: float = 0.0  # N, the force of the room on the robot, in the robot's frame
    fy: float = 0.0  # N


class PlanarRobot(Robot):
    """A robot for tests and for machines without GL. It moves exactly as commanded unless something is in the way.

    Its battery charges while it stands at its dock, however it got there.
    """

    tick_seconds = 0.004
    ticks_on_command = True
    rests_from_thread = True

    def __init__(self, state: PlanarState | None = None) -> None:
        self._state = state or PlanarState()
        self._home = self._state[:3]
        self._light = False
        self._map = make_map(clock.now())
        self._going: Going | None = None
        self._battery = SimulatedBattery()
        self._command = (0.0, 0.0, 0.0)
        self._braked = False  # the stop holds the wheels
        self._sound = Synthesiser()
        drawings = ((OVERVIEW, OverviewDrawing), (FRONT, FrontDrawing))
        self._sources: tuple[MediaSource, ...] = (
            *(CameraSource(each, kind(each.width, each.height).draw, lambda: self._state) for each, kind in drawings),
            MicrophoneSource(MICROPHONE, self._hear),
        )

    @property
    def state(self) -> PlanarState:
        return self._state

    def describe(self) -> RobotDescription:
        return DESCRIPTION

    def apply(self, values: Sequence[float]) -> None:
        vx, vy, wz = (0.0, 0.0, 0.0) if self._braked else values
        self._command = (vx, vy, wz)

    def tick(self) -> None:
        dt = self.tick_seconds
        vx, vy, wz = self._command
        before = self._state
        moving = bool(vx or vy or wz)
        self._battery.tick(dt, moving=moving, charging=not moving and is_docked(before))
        if not (vx or vy or wz or before.vx or before.vy or before.wz or before.fx or before.fy):
            return
        yaw = math.remainder(before.yaw + wz * dt, math.tau)
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = before.x + (cos * vx - sin * vy) * dt, before.y + (sin * vx + cos * vy) * dt
        fx = fy = 0.0
        for contact in contacts(x, y, RADIUS):
            x, y = x + contact.depth * contact.nx, y + contact.depth * contact.ny
            force = STIFFNESS * contact.depth / dt
            fx, fy = fx + force * contact.nx, fy + force * contact.ny
        moved_x, moved_y = (x - before.x) / dt, (y - before.y) / dt
        self._state = PlanarState(
            x=x,
            y=y,
            yaw=yaw,
            vx=cos * moved_x + sin * moved_y,
            vy=-sin * moved_x + cos * moved_y,
            wz=wz,
            fx=cos * fx + sin * fy,
            fy=-sin * fx + cos * fy,
        )

    def measure(self) -> Measurement:
        state = self._state
        distances, _ = ray_hits(state.x, state.y, state.yaw + ANGLES)
        return Measurement(
            axes=[state.vx, state.vy, state.wz],
            joints=[state.x, state.y, state.yaw],
            wrench=[state.fx, state.fy, 0.0, 0.0, 0.0, 0.0],
            ranges=np.clip(distances, RANGES.range_min, RANGES.range_max).tolist(),
            at_rest=max(abs(state.vx), abs(state.vy), abs(state.wz)) < 1e-3,
            faults=[],
        )

    def positions(self) -> Sequence[float]:
        return self._state[:3]

    def rest_from_thread(self) -> None:
        self._command = (0.0, 0.0, 0.0)

    def stop(self) -> None:
        self._braked = True
        self._command = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        self._braked = False

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if name == "light":
            self._light = parameters["on"] is True
            return ActionDone("on" if self._light else "off")
        if name == "go_to":
            return self._go((number(parameters["x"]), number(parameters["y"]), number(parameters["yaw"])))
        if name == "dock":
            return self._go(DOCK, "at the charger")
        return Homing(lambda: self._state[:3], self._home, speed=HOMING_SPEED, turn=HOMING_TURN, tick=self.tick_seconds)

    def _go(self, goal: PlanarPose, result: str = "arrived") -> ActionRun:
        if not has_room(goal[0], goal[1], RADIUS + CLEARANCE):
            raise ActionNotPossible("there is no room at that place")
        here = self._state[:2]

        def leaves(x: float, y: float) -> bool:
            """Return whether the robot fits there on its way out of a narrow place."""
            return math.dist(here, (x, y)) < LEAVING and has_room(x, y, RADIUS - TOUCHING)

        self._going = Going(
            lambda: self._state[:3],
            goal,
            lambda x, y: has_room(x, y, RADIUS + CLEARANCE) or leaves(x, y),
            speed=GOING_SPEED,
            turn=HOMING_TURN,
            tick=self.tick_seconds,
            ended=self._arrived,
            result=result,
        )
        return self._going

    def _arrived(self) -> None:
        self._going = None

    def grid_map(self) -> GridMap | None:
        return self._map

    def navigation(self) -> NavigationNow:
        if self._going is None:
            return NavigationNow(frame=HERE)
        return NavigationNow(frame=HERE, goal=self._going.goal, path=self._going.path(), path_time=clock.now())

    def status(self) -> Sequence[StatusItem]:
        light = StatusItem(name="light", label="Light", kind="switch", value=self._light)
        return (self._battery.item(), light)

    def sources(self) -> Sequence[MediaSource]:
        return self._sources

    def _hear(self) -> bytes:
        state = self._state
        return self._sound.segment(math.hypot(state.vx, state.vy) + 0.3 * abs(state.wz))


def is_docked(state: PlanarState) -> bool:
    """Return whether the robot is where it charges."""
    near, straight = DOCKED
    away, turned = math.hypot(state.x - DOCK[0], state.y - DOCK[1]), math.remainder(state.yaw - DOCK[2], math.tau)
    return away < near and abs(turned) < straight


def number(value: ParameterValue) -> float:
    """Return the value of a parameter that the bridge has checked to be a number."""
    assert isinstance(value, float | int)
    return float(value)
