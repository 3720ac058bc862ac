"""The mobile manipulator: its drives, senses, cameras and microphone around one simulation."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.actions import ActionDone, ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.microphone_source import SEGMENT_SECONDS, MicrophoneSource
from lockstep.robot_bridge.robots.mobile_manipulator.arm_drive import ArmDrive
from lockstep.robot_bridge.robots.mobile_manipulator.base_drive import BaseDrive
from lockstep.robot_bridge.robots.mobile_manipulator.contact_sense import ContactSense
from lockstep.robot_bridge.robots.mobile_manipulator.description import CAMERAS, MICROPHONE, describe, with_goals
from lockstep.robot_bridge.robots.mobile_manipulator.goal_driven.arm import GoalArm
from lockstep.robot_bridge.robots.mobile_manipulator.hearing import Hearing
from lockstep.robot_bridge.robots.mobile_manipulator.range_ring import RangeSensors
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import BASE, Simulation
from lockstep.robot_bridge.robots.mobile_manipulator.sound import Sound
from lockstep.robot_bridge.robots.mujoco_view.renderer import Renderer
from lockstep.robot_bridge.robots.simulated_battery import SimulatedBattery

__all__ = ["MobileManipulator"]

STEPS_PER_TICK: Final = 2
DIGITS: Final = 5  # of measured values on the wire
STILL: Final = (0.0, 0.0, 0.0)  # of the base
REST_SPEED: Final = 0.02  # m/s and rad/s, of every joint


class MobileManipulator(Robot):
    """The axes are the base's velocity in its own frame and the tool's twist against the base, in the base frame.

    With goals, the arm's axes are the places of its joints and the tool's pose against its mount instead.
    """

    ticks_on_command = True
    rests_from_thread = True

    def __init__(self, *, goals: bool = False) -> None:
        """Start the simulation and the renderer.

        Raises:
            RobotUnavailable: OpenGL cannot be used here.
        """
        self.simulation = Simulation()
        model = self.simulation.model
        self.tick_seconds = STEPS_PER_TICK * float(model.opt.timestep)
        self._description = describe(model)
        self._base = BaseDrive()
        self._arm: ArmDrive | GoalArm = ArmDrive(self.simulation)
        if goals:
            self._description = with_goals(self._description)
            self._arm = GoalArm(self.simulation, self._description)
        self._contacts = ContactSense(model)
        self._ranges = RangeSensors(model)
        self._hearing = Hearing(model)
        self._sound = Sound(MICROPHONE.sample_rate, round(MICROPHONE.sample_rate * SEGMENT_SECONDS))
        self._values: Sequence[float] | None = None  # None: at rest
        self._stopped = False  # the base is parked and the arm holds its posture, at any applied value
        # The simulation has, which holds the arm where it is then, and the bridge does not know yet.
        self._began_anew = False
        self._light = False
        self._battery = SimulatedBattery()
        self._renderer = Renderer(model, CAMERAS[0].width, CAMERAS[0].height)
        self._sources: tuple[MediaSource, ...] = (
            *(CameraSource(each, self._renderer.drawing(each), self.simulation.snapshot) for each in CAMERAS),
            MicrophoneSource(MICROPHONE, self._hear, begin=self._hearing.take),
        )

    def describe(self) -> RobotDescription:
        return self._description

    def apply(self, values: Sequence[float]) -> None:
        self._values = None if self._stopped else values

    def pursue_poses(self, names: Sequence[str]) -> None:
        if isinstance(self._arm, GoalArm):
            self._arm.pursues = bool(names)

    def tick(self) -> None:
        data, values = self.simulation.data, self._values
        base = STILL if values is None else values[BASE]
        self._battery.tick(self.tick_seconds, moving=any(base) or self._arm.moving)
        self._base.drive(data, base)
        self._arm.drive(None if values is None else values[BASE.stop :], self.tick_seconds)
        if not self.simulation.step(STEPS_PER_TICK):
            self._began_anew = True
            self._base.release()
            self._arm.release()
            self._contacts.clear()
        self._hearing.listen(data, self._contacts.update(data, self.tick_seconds))

    def prepare(self) -> None:
        if isinstance(self._arm, GoalArm):
            self._arm.prepare()

    def measure(self) -> Measurement:
        simulation = self.simulation
        return Measurement(
            axes=on_wire(np.array(self.measured_axes())),
            joints=on_wire(simulation.joints),
            wrench=on_wire(self._contacts.wrench),
            ranges=on_wire(self._ranges.read(simulation.data)),
            at_rest=bool(np.abs(simulation.joint_velocities).max() < REST_SPEED),
            faults=self._faults(),
        )

    def measured_axes(self) -> list[float]:
        return [*self.simulation.base_velocity().tolist(), *self._arm.measured()]

    def goals(self) -> list[float]:
        return [*STILL, *self._arm.pursued()]

    def take_up(self) -> Sequence[float] | None:
        anew, self._began_anew = self._began_anew, False
        return self.goals() if anew else None

    def positions(self) -> Sequence[float]:
        joints: list[float] = self.simulation.joints.tolist()
        return joints

    def joint_rates(self, values: Sequence[float]) -> Sequence[float] | None:
        """Return the rates of the arm's joints; the base's rates are left out: no limit by posture needs them."""
        rates = self._arm.rates(values[BASE.stop :])
        return None if rates is None else [*STILL, *rates]

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if name == "home":
            return self._arm.home(self.tick_seconds)
        self._light = parameters["on"] is True
        return ActionDone("on" if self._light else "off")

    def status(self) -> Sequence[StatusItem]:
        light = StatusItem(name="light", label="Light", kind="switch", value=self._light)
        return (self._battery.item(), light)

    def rest_from_thread(self) -> None:
        self._values = None
        self._arm.stay()

    def stop(self) -> None:
        self._stopped = True
        self._arm.stay()
        self._values = None

    def reset(self) -> None:
        self._stopped = False
        self._arm.restart()

    def sources(self) -> Sequence[MediaSource]:
        return self._sources

    def close(self) -> None:
        self._renderer.close()

    def _hear(self) -> bytes:
        return self._sound.segment(self._hearing.take())

    def _faults(self) -> list[str]:
        restarts = self.simulation.restarts
        diverged = [f"the simulation diverged and was restarted ({restarts} times)"] if restarts else []
        return [*diverged, *self._arm.faults]


def on_wire(values: np.typing.NDArray[np.float64]) -> list[float]:
    """Round values to keep messages small; never -0."""
    return [value + 0.0 for value in np.round(values, DIGITS).tolist()]
