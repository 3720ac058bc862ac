"""A robot from a MuJoCo model: its drives, senses and cameras around one simulation."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from lockstep.protocol.actions import ParameterValue
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.go_to import GoTo
from lockstep.robot_bridge.robots.mjcf.actuators import actuators_of
from lockstep.robot_bridge.robots.mjcf.bodies import DRAWN_GROUPS, bodies_of
from lockstep.robot_bridge.robots.mjcf.cameras import cameras_of
from lockstep.robot_bridge.robots.mjcf.description import describe
from lockstep.robot_bridge.robots.mjcf.drives import Drive, drives_of
from lockstep.robot_bridge.robots.mjcf.goal_setting import goal_actuators, gripper_actuators
from lockstep.robot_bridge.robots.mjcf.joints import joints_of
from lockstep.robot_bridge.robots.mjcf.keyframes import keyframes_of
from lockstep.robot_bridge.robots.mjcf.model_file import load_model
from lockstep.robot_bridge.robots.mjcf.senses import range_sense, wrench_sense
from lockstep.robot_bridge.robots.mjcf.simulation import Simulation
from lockstep.robot_bridge.robots.mjcf.tools.tool_set import ToolSet
from lockstep.robot_bridge.robots.mjcf.tools.tool_setting import tools_of
from lockstep.robot_bridge.robots.mujoco_view.canvas import Look
from lockstep.robot_bridge.robots.mujoco_view.renderer import Renderer

__all__ = ["MjcfRobot"]

REST_SPEED: Final = 0.02  # rad/s, or of the model's size per second
NOT_THERE: Final = "it stays short of the posture: something is in its way, or its servos are too weak"


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
        self.simulation = simulation = Simulation(load_model(path))
        model, data = simulation.model, simulation.data
        self.tick_seconds = simulation.tick_seconds
        actuators = actuators_of(model)
        found = tools_of(model, actuators)
        arms = {servo.number for tool in found for servo in tool.servos}
        grippers = gripper_actuators(model, actuators, arms)
        self._drives = drives_of(model, data, actuators, goal_actuators(model, actuators) | grippers | arms, grippers)
        self._keyframes = keyframes_of(model, self._drives)
        self._joints = joints_of(model)
        bodies = bodies_of(model, self._joints)
        self._tools = ToolSet(model, data, found, self._drives, bodies)
        self._wrench = wrench_sense(model)
        self._ranges = range_sense(model, data)
        cameras = cameras_of(model)
        # The simulation has, which holds the arm where it is then, and the bridge does not know yet.
        self._began_anew = False
        self._values = [drive.at_rest(drive.measured(data)) for drive in self._drives] + self._tools.measured()
        self._now = now
        self._ticked_at = now()
        self._pursued: Sequence[str] = ()  # poses that commands drive
        self._stopped = False  # every drive holds its place, at any applied value
        self._moving = moving_dofs(model, self._drives)
        self._description = describe(
            *(path.stem, simulation, self._drives, self._joints, bodies, self._tools),
            cameras,
            self._wrench,
            self._ranges,
            [keyframe.action for keyframe in self._keyframes.values()],
        )
        self._drive(0.0)
        simulation.keep_up()
        self._release()
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
        self._sources = tuple(
            CameraSource(camera, self._renderer.drawing(camera), simulation.snapshot) for camera in cameras
        )

    def describe(self) -> RobotDescription:
        return self._description

    def pursue_poses(self, names: Sequence[str]) -> None:
        self._pursued = names

    def apply(self, values: Sequence[float]) -> None:
        self._values = self._at_rest() if self._stopped else list(values)

    def tick(self) -> None:
        ticked_at, self._ticked_at = self._ticked_at, self._now()
        self._drive(self._ticked_at - ticked_at)
        if not self.simulation.tick():
            self._release()
            if self._wrench is not None:
                self._wrench.clear()
        if self._wrench is not None:
            self._wrench.read(self.simulation.data, self.tick_seconds)

    def prepare(self) -> None:
        self._tools.prepare()

    def measure(self) -> Measurement:
        data = self.simulation.data
        is_still = not self._moving.size or bool((np.abs(data.qvel) * self._moving).max() < REST_SPEED)
        return Measurement(
            axes=self.measured_axes(),
            joints=[short(value) for value in self.positions()],
            wrench=[] if self._wrench is None else [short(value) for value in self._wrench.value.tolist()],
            ranges=[] if self._ranges is None else [short(value) for value in self._ranges.read(data)],
            at_rest=is_still and self._values == self._at_rest(),
            faults=self._tools.faults + self.simulation.faults,
        )

    def measured_axes(self) -> list[float]:
        return [short(value) for value in (*self._measured_drives(), *self._tools.measured())]

    def goals(self) -> list[float]:
        goals = list(self._values)  # also while it is stopped: the servos hold there
        self._tools.put_pursued(goals)
        return goals

    def take_up(self) -> Sequence[float] | None:
        anew, self._began_anew = self._began_anew, False
        return self.goals() if anew else None

    def positions(self) -> Sequence[float]:
        qpos = self.simulation.data.qpos
        return [value for joint in self._joints for value in joint.values(qpos)]

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if self._stopped:
            raise ActionNotPossible("the robot is stopped")
        keyframe = self._keyframes[name]
        return GoTo(
            *(keyframe.goals, self._description.axes, self._measured_drives, self.tick_seconds),
            keyframe.action.label,
            NOT_THERE,
        )

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

    def _measured_drives(self) -> list[float]:
        return [drive.measured(self.simulation.data) for drive in self._drives]

    def _release(self) -> None:
        """Hold everything where the state begins."""
        self._began_anew = True
        for number, drive in enumerate(self._drives):
            drive.release(self.simulation.data)
            if drive.axis.kind == "goal":
                self._values[number] = drive.measured(self.simulation.data)
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
            drive.drive(self.simulation.data, value, seconds)


def moving_dofs(model: Any, drives: Sequence[Drive]) -> npt.NDArray[np.float64]:
    """Return a weight for each degree of freedom: 0 if no actuator moves it, else the scale of its speed."""
    weights = np.zeros(model.nv)
    for drive in drives:
        joint = drive.actuator.joint
        if joint is not None:
            size = 1.0 if drive.actuator.is_rotary else float(model.stat.extent)
            weights[model.jnt_dofadr[joint]] = 1.0 / size
    return weights


def short(value: float) -> float:
    """Round to six significant digits at any scale, which keeps messages small; never -0."""
    return float(f"{value:.6g}") + 0.0
