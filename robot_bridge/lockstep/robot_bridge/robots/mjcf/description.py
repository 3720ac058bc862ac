"""Describes a robot from the parts of its model."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from lockstep.protocol.description import Action, AxisGain, Body, Camera, PositionLimit, RobotDescription
from lockstep.robot_bridge.robots.mjcf.actuators import Kind
from lockstep.robot_bridge.robots.mjcf.controls import layers_of
from lockstep.robot_bridge.robots.mjcf.drives import Drive
from lockstep.robot_bridge.robots.mjcf.joints import ModelJoint
from lockstep.robot_bridge.robots.mjcf.names import label_of
from lockstep.robot_bridge.robots.mjcf.senses import RangeSense, WrenchSense
from lockstep.robot_bridge.robots.mjcf.simulation import Simulation
from lockstep.robot_bridge.robots.mjcf.tools.tool_set import ToolSet
from lockstep.robot_bridge.robots.mujoco_view.calibration import calibrated
from lockstep.robot_bridge.robots.mujoco_view.canvas import FREE_CAMERA

__all__ = ["describe"]

EVENT_RATE: Final = 60.0  # Hz, at most
WATCHDOG: Final = 0.25  # s; a simulation hurts no person, and busy machines hold it up
MARGIN: Final = 0.01  # of a joint's range, by which servos run on
LATENCY: Final = 0.03  # s by which servos follow late


def describe(
    name: str,
    simulation: Simulation,
    drives: Sequence[Drive],
    joints: Sequence[ModelJoint],
    bodies: Sequence[Body],
    tools: ToolSet,
    cameras: Mapping[Camera, int],
    wrench: WrenchSense | None,
    ranges: RangeSense | None,
    actions: Sequence[Action],
) -> RobotDescription:
    """Return the description. `name`: of the file. `cameras`: with their numbers in the model."""
    model, data = simulation.model, simulation.data
    by_stick = [drive for drive in drives if tools.poses or drive.axis.kind == "rate"]
    title = model.names[: model.names.index(b"\0")].decode(errors="replace")
    return RobotDescription(
        name=name,
        watchdog=WATCHDOG,
        max_event_rate=EVENT_RATE,
        label=label_of(name if title in ("", "MuJoCo Model") else title),
        axes=(*(drive.axis for drive in drives), *tools.axes),
        joints=tuple(part for joint in joints for part in joint.parts),
        layers=(
            *tools.layers,
            *layers_of(model, data, [drive.axis for drive in by_stick], [drive.actuator for drive in by_stick]),
        ),
        cameras=tuple(_calibrated(camera, number, model, bodies) for camera, number in cameras.items()),
        wrench=None if wrench is None else wrench.description,
        ranges=None if ranges is None else ranges.description,
        actions=tuple(actions),
        bodies=(*_with_rays(bodies, ranges), *tools.bodies),
        poses=tools.poses,
        position_limits=tuple(_limit(drive, model, joints) for drive in drives if _is_limited(drive, model)),
    )


def _calibrated(camera: Camera, number: int, model: Any, bodies: Sequence[Body]) -> Camera:
    named = number != FREE_CAMERA and model.camera(number).name
    return calibrated(camera, model, bodies) if named else camera


def _with_rays(found: Sequence[Body], rays: RangeSense | None) -> tuple[Body, ...]:
    names = {body.name for body in found}
    return (*found, rays.body) if rays is not None and rays.body.parent in names else tuple(found)


def _is_limited(drive: Drive, model: Any) -> bool:
    joint = drive.actuator.joint
    is_speed = drive.axis.kind == "rate" and drive.actuator.kind in (Kind.POSITION, Kind.VELOCITY)
    return is_speed and joint is not None and bool(model.jnt_limited[joint])


def _limit(drive: Drive, model: Any, joints: Sequence[ModelJoint]) -> PositionLimit:
    low, high = (float(bound) for bound in model.jnt_range[drive.actuator.joint])
    joint = next(each for each in joints if each.number == drive.actuator.joint)
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
