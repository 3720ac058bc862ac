"""A robot from a MuJoCo model: its drives, senses and cameras around one simulation."""

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import AxisGain, Body, Camera, PositionLimit, RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.mjcf.actuators import Kind, actuators_of
from lockstep.robot_bridge.robots.mjcf.bodies import DRAWN_GROUPS, bodies_of
from lockstep.robot_bridge.robots.mjcf.cameras import cameras_of
from lockstep.robot_bridge.robots.mjcf.controls import layers_of
from lockstep.robot_bridge.robots.mjcf.drives import Drive, drives_of
from lockstep.robot_bridge.robots.mjcf.goal_setting import goal_actuators, gripper_actuators
from lockstep.robot_bridge.robots.mjcf.joints import joints_of
from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from lockstep.robot_bridge.robots.mjcf.names import label_of
from lockstep.robot_bridge.robots.mjcf.senses import range_sense, wrench_sense
from lockstep.robot_bridge.robots.mjcf.tools.tool_set import ToolSet
from lockstep.robot_bridge.robots.mjcf.tools.tool_setting import tools_of
from lockstep.robot_bridge.robots.mujoco_view.calibration import calibrated
from lockstep.robot_bridge.robots.mujoco_view.canvas import FREE_CAMERA, Look
from lockstep.robot_bridge.robots.mujoco_view.renderer import Renderer

__all__ = ["MjcfRobot"]

TICK: Final = 0.004  # s, about
BUSIEST: Final = 0.6  # share of a tick that the simulation may take
TRIED_TICKS: Final = 25
EVENT_RATE: Final = 60.0  # Hz, at most
WATCHDOG: Final = 0.25  # s; a simulation hurts no person, and busy machines hold it up
REST_SPEED: Final = 0.02  # rad/s, or of the model's size per second
MARGIN: Final = 0.01  # of a joint's range, by which servos run on
LATENCY: Final = 0.03  # s by which servos follow late

_logger = logging.getLogger(__name__)


class MjcfRobot(Robot):
    """A robot with an axis for every actuator, except velocity servos that only damp a position servo.

    The axes of tools that are driven by their pose follow.
    """

    ticks_on_command = True
    rests_from_thread = True

    def __init__(self, path: Path, *, now: Callable[[], float] = clock.now) -> None:
        """Load the model and start the renderer. `now`: s, monotonic.

        Raises:
            ModelError: the file is not a model that can be driven.
            RobotUnavailable: OpenGL cannot be used here.
        """
        mujoco.set_mju_user_warning(warn)  # else MuJoCo writes a file into the working directory
        self.model = model = load_model(path)
        self.data = data = mujoco.MjData(model)
        self.restarts = 0
        self._begin()
        actuators = actuators_of(model)
        found = tools_of(model, actuators)
        arms = {servo.number for tool in found for servo in tool.servos}
        grippers = gripper_actuators(model, actuators, arms)
        self._drives = drives_of(model, data, actuators, goal_actuators(model, actuators) | grippers | arms, grippers)
        self._joints = joints_of(model)
        bodies = bodies_of(model, self._joints)
        self._tools = ToolSet(model, data, found, self._drives, bodies)
        self._wrench = wrench_sense(model)
        self._ranges = range_sense(model, data)
        cameras = cameras_of(model)
        self._values = [drive.at_rest(drive.measured(data)) for drive in self._drives] + self._tools.measured()
        self._now = now
        self._ticked_at = now()
        self._pursued: Sequence[str] = ()  # poses that commands drive
        self._stopped = False  # every drive holds its place, at any applied value
        self._moving = self._moving_dofs()
        self._description = self._describe(path.stem, cameras, bodies)
        step = float(model.opt.timestep)
        self._steps = max(1, round(TICK / step))
        self.tick_seconds = self._steps * step
        self._slowness = self._keep_up()
        look = Look(
            groups=tuple(int(group in DRAWN_GROUPS) for group in range(6)),
            max_geoms=max(1000, 2 * model.ngeom),
            cameras={camera.name: number for camera, number in cameras.items()},
            has_soft_parts=bool(model.ntendon or model.nflex or model.nskin),
        )
        width, height = (max(getattr(camera, side) for camera in cameras) for side in ("width", "height"))
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0  # on a CPU they cost ten times the rest
        self._renderer = Renderer(model, width, height, look)
        self._sources = tuple(CameraSource(camera, self._renderer.drawing(camera), self.snapshot) for camera in cameras)

    def describe(self) -> RobotDescription:
        return self._description

    def pursue_poses(self, names: Sequence[str]) -> None:
        self._pursued = names

    def apply(self, values: Sequence[float]) -> None:
        self._values = self._at_rest() if self._stopped else list(values)

    def tick(self) -> None:
        before, ticked_at = self.data.time, self._ticked_at
        self._ticked_at = self._now()
        self._drive(self._ticked_at - ticked_at)
        mujoco.mj_step(self.model, self.data, self._steps)
        if self.data.time <= before or not np.isfinite(self.data.qvel).all():
            self._restart()
        if self._wrench is not None:
            self._wrench.read(self.data, self.tick_seconds)

    def measure(self) -> Measurement:
        data = self.data
        is_still = not self._moving.size or bool((np.abs(data.qvel) * self._moving).max() < REST_SPEED)
        return Measurement(
            axes=self.measured_axes(),
            joints=[short(value) for value in self.positions()],
            wrench=[] if self._wrench is None else [short(value) for value in self._wrench.value.tolist()],
            ranges=[] if self._ranges is None else [short(value) for value in self._ranges.read(data)],
            at_rest=is_still and self._values == self._at_rest(),
            faults=self._faults(),
        )

    def measured_axes(self) -> list[float]:
        measured = [drive.measured(self.data) for drive in self._drives]
        return [short(value) for value in (*measured, *self._tools.measured())]

    def goals(self) -> list[float]:
        goals = list(self._values)  # also while it is stopped: the servos hold there
        self._tools.put_pursued(goals)
        return goals

    def positions(self) -> Sequence[float]:
        qpos = self.data.qpos
        return [value for joint in self._joints for value in joint.values(qpos)]

    def rest_from_thread(self) -> None:
        self._rest()

    def stop(self) -> None:
        self._stopped = True
        self._rest()

    def reset(self) -> None:
        self._stopped = False
        self._tools.restart()

    def sources(self) -> Sequence[MediaSource]:
        return self._sources

    def close(self) -> None:
        self._renderer.close()

    def snapshot(self) -> npt.NDArray[np.float64]:
        """Return the part of the present state that a picture needs."""
        state: npt.NDArray[np.float64] = self.data.qpos.copy()
        return state

    def _begin(self) -> None:
        """Set the model's first keyframe if it has one, else its zero; nothing moves yet."""
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
            self.data.qvel[:] = 0
        else:
            mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)

    def _restart(self) -> None:
        self.restarts += 1
        self._begin()
        self._release()
        if self._wrench is not None:
            self._wrench.clear()

    def _release(self) -> None:
        """Hold everything where the state begins."""
        for drive in self._drives:
            drive.release(self.data)
        self._tools.restart(measured=True)

    def _rest(self) -> None:
        self._values = self._at_rest()
        self._tools.hold()

    def _at_rest(self) -> list[float]:
        values = [drive.at_rest(value) for drive, value in zip(self._drives, self._values, strict=False)]
        return [*values, *self._values[len(values) :]]

    def _drive(self, since: float) -> None:
        """Set the controls for the coming tick. `since`: s since the last."""
        values, seconds = list(self._values), self.tick_seconds
        if not self._stopped:
            self._tools.drive(values, seconds, since, self._pursued)
        self._tools.put_pursued(values)
        for drive, value in zip(self._drives, values, strict=False):
            drive.drive(self.data, value, seconds)

    def _keep_up(self) -> float:
        """Reduce the steps of a tick if they would take too long; return how many times slower than real time they run.

        The steps must leave the loop some time.
        """
        began = time.process_time()
        self._drive(0.0)
        mujoco.mj_step(self.model, self.data, self._steps * TRIED_TICKS)
        taken = (time.process_time() - began) / TRIED_TICKS
        self._begin()
        self._release()
        fitting = max(1, math.floor(self._steps * BUSIEST * self.tick_seconds / max(taken, 1e-9)))
        if fitting >= self._steps:
            return 1.0
        slowness = self._steps / fitting
        _logger.warning("the simulation takes too long: it runs %.1f times slower than real time", slowness)
        self._steps = fitting
        return slowness

    def _moving_dofs(self) -> npt.NDArray[np.float64]:
        """Return a weight for each degree of freedom: 0 if no actuator moves it, else the scale of its speed."""
        weights = np.zeros(self.model.nv)
        for drive in self._drives:
            joint = drive.actuator.joint
            if joint is not None:
                size = 1.0 if drive.actuator.is_rotary else float(self.model.stat.extent)
                weights[self.model.jnt_dofadr[joint]] = 1.0 / size
        return weights

    def _describe(self, name: str, cameras: Mapping[Camera, int], bodies: Sequence[Body]) -> RobotDescription:
        by_stick = [drive for drive in self._drives if self._tools.poses or drive.axis.kind == "rate"]
        title = self.model.names[: self.model.names.index(b"\0")].decode(errors="replace")
        return RobotDescription(
            name=name,
            watchdog=WATCHDOG,
            max_event_rate=EVENT_RATE,
            label=label_of(name if title in ("", "MuJoCo Model") else title),
            axes=(*(drive.axis for drive in self._drives), *self._tools.axes),
            joints=tuple(part for joint in self._joints for part in joint.parts),
            layers=(
                *self._tools.layers,
                *layers_of(
                    self.model, self.data, [drive.axis for drive in by_stick], [drive.actuator for drive in by_stick]
                ),
            ),
            cameras=tuple(self._calibrated(camera, number, bodies) for camera, number in cameras.items()),
            wrench=None if self._wrench is None else self._wrench.description,
            ranges=None if self._ranges is None else self._ranges.description,
            bodies=(*self._with_rays(bodies), *self._tools.bodies),
            poses=self._tools.poses,
            position_limits=tuple(self._limit(drive) for drive in self._drives if self._is_limited(drive)),
        )

    def _calibrated(self, camera: Camera, number: int, bodies: Sequence[Body]) -> Camera:
        named = number != FREE_CAMERA and self.model.camera(number).name
        return calibrated(camera, self.model, bodies) if named else camera

    def _with_rays(self, found: Sequence[Body]) -> tuple[Body, ...]:
        rays = self._ranges
        names = {body.name for body in found}
        return (*found, rays.body) if rays is not None and rays.body.parent in names else tuple(found)

    def _is_limited(self, drive: Drive) -> bool:
        joint = drive.actuator.joint
        is_speed = drive.axis.kind == "rate" and drive.actuator.kind in (Kind.POSITION, Kind.VELOCITY)
        return is_speed and joint is not None and bool(self.model.jnt_limited[joint])

    def _limit(self, drive: Drive) -> PositionLimit:
        low, high = (float(bound) for bound in self.model.jnt_range[drive.actuator.joint])
        joint = next(each for each in self._joints if each.number == drive.actuator.joint)
        return PositionLimit(
            name=f"{drive.axis.name}.range",
            label=drive.axis.label,
            joint=joint.parts[0].name,
            minimum=low,
            maximum=high,
            axes=(AxisGain(axis=drive.axis.name),),
            margin=MARGIN * (high - low),
            latency=LATENCY,
        )

    def _faults(self) -> list[str]:
        faults = self._tools.faults
        if self.restarts:
            faults.append(f"the simulation diverged and was restarted ({self.restarts} times)")
        if self._slowness > 1:
            faults.append(f"the simulation runs {self._slowness:.1f} times slower than real time")
        return faults


def warn(text: str) -> None:
    _logger.warning("MuJoCo: %s", text)


def short(value: float) -> float:
    """Round to six significant digits at any scale, which keeps messages small; never -0."""
    return float(f"{value:.6g}") + 0.0
