"""The SO-101 arm: its drive, sense and cameras around one simulation."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.kinematics.rotations import rotation_vector
from lockstep.robot_bridge.robots.actions import ActionDone, ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.go_to import GoTo
from lockstep.robot_bridge.robots.mujoco_view.canvas import Look
from lockstep.robot_bridge.robots.mujoco_view.renderer import Renderer
from lockstep.robot_bridge.robots.so101.arm_drive import ArmDrive
from lockstep.robot_bridge.robots.so101.contact_force import ContactForce
from lockstep.robot_bridge.robots.so101.controls import RATES
from lockstep.robot_bridge.robots.so101.description import CAMERAS, describe
from lockstep.robot_bridge.robots.so101.grip_drive import GripDrive
from lockstep.robot_bridge.robots.so101.model import ARM, GRIPPER
from lockstep.robot_bridge.robots.so101.reach import arm_chain, arm_solver
from lockstep.robot_bridge.robots.so101.simulation import HOME, REST_SPEED, Simulation

__all__ = ["So101"]

STEPS_PER_TICK: Final = 2
DIGITS: Final = 5  # of measured values on the wire
FOLDED: Final[tuple[float, ...]] = (0.0, -1.68, 1.48, 0.9, 0.0, 0.0)  # rad, of each joint: low and near the foot
OPEN: Final = 1.2  # rad, of the gripper
JAW: Final = 0.08  # m, from the jaw's joint to its fingertip


class So101(Robot):
    """The axes are goals: of the five joints, the gripper, and the tool's pose, which the joints are solved for."""

    ticks_on_command = True
    rests_from_thread = True

    def __init__(self, arm_file: Path, now: clock.Clock = clock.now) -> None:
        """Start the simulation and the renderer. `now`: the clock that bounds motion.

        Raises:
            ModelError: the file is not the arm that this robot needs.
            RobotUnavailable: OpenGL cannot be used here.
        """
        self.simulation = Simulation(arm_file)
        model = self.simulation.model
        self.tick_seconds = STEPS_PER_TICK * float(model.opt.timestep)
        self._description = describe(model)
        self._chain = arm_chain(self._description)
        solver = arm_solver(self._description, self._chain)
        self._drive = ArmDrive(self._chain, solver, RATES[ARM], HOME[ARM])
        self._grip = GripDrive(RATES[GRIPPER], HOME[GRIPPER])
        self._contact = ContactForce(model)
        self._stopped = False  # the arm holds its posture, at any applied value
        self._values: Sequence[float] | None = None
        # The simulation has, which holds the arm where it is then, and the bridge does not know yet.
        self._began_anew = False
        self._pursues = False  # the tool goes on to a goal that stands still
        self._now = now
        self._ticked_at = now()
        self._renderer = Renderer(model, CAMERAS[0].width, CAMERAS[0].height, Look())
        self._sources = tuple(
            CameraSource(each, self._renderer.drawing(each), self.simulation.snapshot) for each in CAMERAS
        )

    def describe(self) -> RobotDescription:
        return self._description

    def pursue_poses(self, names: Sequence[str]) -> None:
        self._pursues = bool(names)

    def apply(self, values: Sequence[float]) -> None:
        self._values = None if self._stopped else values

    def goals(self) -> Sequence[float]:
        *joints, x, y, z, rx, ry, rz = self._drive.pursued()
        return [*joints, self._grip.goal, x, y, z, rx, ry, rz]

    def take_up(self) -> Sequence[float] | None:
        anew, self._began_anew = self._began_anew, False
        return self.goals() if anew else None

    def tick(self) -> None:
        simulation, seconds = self.simulation, self.tick_seconds
        before, self._ticked_at = self._ticked_at, self._now()
        rates = np.zeros(len(RATES))
        if self._values is not None:
            values, self._values = list(self._values), None
            rates[GRIPPER] = self._grip.drive(values.pop(GRIPPER), seconds)
            since, joints = self._ticked_at - before, simulation.joints()[ARM]
            rates[ARM] = self._drive.drive(values, seconds, since, joints, pursues=self._pursues)
        simulation.aim((*self._drive.goals, self._grip.goal), rates)
        if not simulation.step(STEPS_PER_TICK):
            self._began_anew = True
            self._drive.hold(HOME[ARM])
            self._grip.hold(HOME[GRIPPER])
        self._contact.update(simulation.data, seconds)

    def prepare(self) -> None:
        self._drive.prepare()

    def measure(self) -> Measurement:
        return Measurement(
            axes=on_wire(self.measured_axes()),
            joints=on_wire(self.simulation.joints()),
            wrench=on_wire(self._contact.wrench.tolist()),
            ranges=[],
            at_rest=bool(np.abs(self.simulation.rates()).max() < REST_SPEED),
            faults=self._faults(),
        )

    def measured_axes(self) -> Sequence[float]:
        joints = self.simulation.joints()
        state = self._chain.at(joints[ARM])
        return [*joints, *state.position.tolist(), *rotation_vector(state.rotation).tolist()]

    def positions(self) -> Sequence[float]:
        return self.simulation.joints()

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if name == "reset_scene":
            self.simulation.put_things_back()
            return ActionDone("blocks and bowl are where they began")
        if self._stopped:
            raise ActionNotPossible("the arm is stopped")
        if name == "open_gripper":
            return self._go_to({GRIPPER: OPEN}, "the gripper is open")
        posture, text = (FOLDED, "the arm is folded") if name == "fold" else (HOME, "the arm is at home")
        return self._go_to(dict(enumerate(posture[ARM])), text)

    def status(self) -> Sequence[StatusItem]:
        grip = round(max(0.0, -self.simulation.torque(GRIPPER)) / JAW, 1)
        bowl = self.simulation.blocks_in_bowl()
        return (
            StatusItem(name="grip", label="Grip", kind="number", value=grip, unit="N"),
            StatusItem(name="bowl", label="Blocks in the bowl", kind="number", value=float(bowl)),
        )

    def rest_from_thread(self) -> None:
        self._hold()

    def stop(self) -> None:
        self._stopped = True
        self._hold()

    def reset(self) -> None:
        self._stopped = False
        self._drive.restart()
        self._grip.restart()

    def sources(self) -> Sequence[MediaSource]:
        return self._sources

    def close(self) -> None:
        self._renderer.close()

    def _hold(self) -> None:
        self._values = None
        self._drive.hold()
        self._grip.hold()

    def _go_to(self, goals: Mapping[int, float], text: str) -> GoTo:
        return GoTo(goals, self._description.axes, self.simulation.joints, self.tick_seconds, text)

    def _faults(self) -> list[str]:
        restarts = self.simulation.restarts
        diverged = [f"the simulation diverged and was restarted ({restarts} times)"] if restarts else []
        return [*diverged, *self._drive.faults]


def on_wire(values: Sequence[float]) -> list[float]:
    """Round values to keep messages small; never -0."""
    return [round(value, DIGITS) + 0.0 for value in values]
