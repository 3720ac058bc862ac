"""Makes the description of a ROS 2 robot from its settings."""

import math
from typing import Final

from lockstep.protocol.description import (
    Action,
    ActionParameter,
    Axis,
    AxisGain,
    Body,
    BodyJoint,
    Camera,
    ControlLayer,
    Geom,
    Joint,
    MapView,
    PlanarBase,
    PositionLimit,
    RangeRing,
    RobotDescription,
    WrenchSensor,
)
from lockstep.robot_bridge.robots.ros2.controls import arm_layers, base_layer
from lockstep.robot_bridge.robots.ros2.joint_axes import SLEW_TIME, brake_for, joint_axes
from lockstep.robot_bridge.robots.ros2.saved_poses import pose_actions
from lockstep.robot_bridge.robots.ros2.settings import (
    KINDS,
    NUMBERS,
    ArmJoint,
    Base,
    BaseAxis,
    Gripper,
    MapGoal,
    Ros2Settings,
    RosAction,
    Service,
    Servo,
    kind_of_reading,
)
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["BASE_JOINTS", "GOAL_ACTION", "SERVO_AXES", "describe"]

BASE_JOINTS: Final = ("base.x", "base.y", "base.yaw")
GOAL_ACTION: Final = "go_to"
FARTHEST: Final = 1e5  # m, of a goal on the map
BASE_BODY: Final = "base"
# Four axes are a layer: two sticks move a tool and turn it about its vertical.
SERVO_AXES: Final = ("tool.x", "tool.y", "tool.z", "tool.rz", "tool.rx", "tool.ry")
_COLOUR = (0.25, 0.55, 0.85, 1.0)


OWN_ITEMS = ("hardware_stop", "encoder_fallback")  # of the status, that the bridge adds itself


def describe(settings: Ros2Settings) -> RobotDescription:
    """Return the description of the robot.

    Raises:
        SettingsPlace: the settings contradict each other.
    """
    base, arm = settings.base, settings.arm
    if base is None and arm is None and settings.servo is None:
        raise SettingsPlace((), "there is nothing to drive: give a base, an arm, a servo, or a base and one of those")
    if arm is not None and settings.servo is not None:
        raise SettingsPlace(("servo",), "the joints of an arm are driven by `arm` or by `servo`, not by both")
    if base is None and settings.geofences:
        raise SettingsPlace(("geofences",), "zones need a base")
    for number, camera in enumerate(settings.cameras):
        if settings.use_sim_time and camera.captured == "header":
            keys = ("cameras", number, "captured")
            raise SettingsPlace(keys, "simulated time is not the bridge's time: set captured: arrival, and a latency")
    names = [battery.name for battery in settings.batteries]
    for number, name in enumerate(names):
        if name in names[:number]:
            raise SettingsPlace(("batteries", number, "name"), f"{name!r} is the name of another battery")
        if name in OWN_ITEMS:
            raise SettingsPlace(("batteries", number, "name"), f"{name!r} is the name of an item of the bridge's own")
    _check_readings(settings, names)
    base_axes = () if base is None else _base_axes(base, settings.hold)
    bodies = (() if base is None else (_base_body(base),)) + settings.bodies
    arm_axes = () if arm is None else joint_axes(arm, settings.hold)
    actions = _actions(settings)
    if arm is not None:
        actions = pose_actions(arm, arm_axes, [action.name for action in actions]) + actions
    tool = None
    if arm is not None and arm.tool is not None:
        from lockstep.robot_bridge.robots.ros2.tool import describe_tool  # needs numpy, as few robots do

        cameras = {camera.name: camera.calibration for camera in settings.cameras}
        tool = describe_tool(arm, bodies, cameras, settings.hold)
    if settings.servo is not None:
        arm_axes = _servo_axes(settings.servo, settings.hold)
    layers: tuple[ControlLayer, ...] = ()
    if base is not None:
        layers += (base_layer("base.vx", "base.vy" if base.left else None, "base.wz" if base.turn else None),)
    if tool is not None:
        layers += (tool.layer,)
    return RobotDescription(
        name=settings.name,
        label=settings.label or settings.name,
        axes=base_axes + arm_axes + (() if tool is None else tool.axes.all),
        joints=_joints(settings),
        layers=settings.layers or layers + arm_layers(arm_axes),
        cameras=tuple(
            Camera(
                name=camera.name,
                label=camera.label or camera.name,
                width=camera.width,
                height=camera.height,
                frame_rate=camera.frame_rate,
                calibration=camera.calibration,
            )
            for camera in settings.cameras
        ),
        wrench=_wrench(settings),
        ranges=_ranges(settings),
        bodies=bodies + (() if tool is None else (tool.body,)),
        poses=() if tool is None else (tool.pose,),
        position_limits=() if arm is None else tuple(filter(None, map(_position_limit, arm.joints))),
        planar_base=None if base is None else _planar_base(base),
        geofences=settings.geofences,
        actions=actions,
        map=_map(settings),
        hold=settings.hold,
        watchdog=settings.watchdog,
        max_event_age=settings.max_event_age,
        max_event_rate=settings.max_event_rate,
    )


def _actions(settings: Ros2Settings) -> tuple[Action, ...]:
    actions = [
        *map(_service, settings.services),
        *map(_ros_action, settings.actions),
        *map(_gripper, settings.grippers),
    ]
    if settings.map is not None and settings.map.goal is not None:
        actions.append(_goal(settings.map.goal))
    return tuple(actions)


def _ros_action(action: RosAction) -> Action:
    return Action(
        name=action.name,
        label=action.label or action.name,
        moves=action.moves,
        confirm=action.confirm,
        parameters=tuple(
            ActionParameter(
                name=parameter.name or parameter.field,
                label=parameter.label or parameter.name or parameter.field,
                kind=parameter.kind,
                unit=parameter.unit,
                minimum=parameter.minimum,
                maximum=parameter.maximum,
                choices=parameter.choices,
                default=parameter.default,
            )
            for parameter in action.parameters
        ),
    )


def _gripper(gripper: Gripper) -> Action:
    opening = ActionParameter(
        name="opening", label="Opening", kind="number", unit="%", minimum=0, maximum=100, default=100.0
    )
    return Action(name=gripper.name, label=gripper.label, parameters=(opening,))


def _goal(goal: MapGoal) -> Action:
    return Action(
        name=GOAL_ACTION,
        label=goal.label,
        parameters=(
            ActionParameter(name="x", label="x", kind="number", unit="m", minimum=-FARTHEST, maximum=FARTHEST),
            ActionParameter(name="y", label="y", kind="number", unit="m", minimum=-FARTHEST, maximum=FARTHEST),
            ActionParameter(name="yaw", label="Heading", kind="number", unit="rad", minimum=-4, maximum=4, default=0.0),
        ),
    )


def _map(settings: Ros2Settings) -> MapView | None:
    if settings.map is None:
        return None
    if settings.base is None:
        raise SettingsPlace(("map",), "a map needs a base, whose place on it is shown")
    x, y, yaw = BASE_JOINTS
    radius = settings.base.radius or 0.1
    return MapView(x=x, y=y, yaw=yaw, radius=radius, goal="" if settings.map.goal is None else GOAL_ACTION)


def _service(service: Service) -> Action:
    on = ActionParameter(name="on", label="On", kind="switch", default=True)
    return Action(
        name=service.name,
        label=service.label or service.name,
        moves=False,
        parameters=(on,) if service.type == "SetBool" else (),
        confirm=service.confirm,
    )


def _base_axes(base: Base, hold: float) -> tuple[Axis, ...]:
    named = (
        ("base.vx", "Forward", "m/s", base.forward, "forward"),
        ("base.vy", "Left", "m/s", base.left, "left"),
        ("base.wz", "Turn left", "rad/s", base.turn, "turn"),
    )
    return tuple(
        _base_axis(name, label, unit, axis, hold, key) for name, label, unit, axis, key in named if axis is not None
    )


def _base_axis(name: str, label: str, unit: str, axis: BaseAxis, hold: float, key: str) -> Axis:
    minimum = -axis.maximum if axis.minimum is None else axis.minimum
    if minimum > 0:
        raise SettingsPlace(("base", key, "minimum"), "must not be above 0, which is rest")
    fastest = max(axis.maximum, -minimum)
    return Axis(
        name=name,
        label=label,
        unit=unit,
        minimum=minimum,
        maximum=axis.maximum,
        slew=axis.slew or fastest / SLEW_TIME,
        brake=brake_for(axis.brake, fastest, hold, ("base", key, "brake")),
    )


def _servo_axes(servo: Servo, hold: float) -> tuple[Axis, ...]:
    words = {"x": "Tool along x", "y": "Tool along y", "z": "Tool along z"}
    words |= {"rz": "Tool about z", "rx": "Tool about x", "ry": "Tool about y"}
    axes = []
    for name in SERVO_AXES:
        direction = name.partition(".")[2]
        turns = direction.startswith("r")
        fastest = servo.angular if turns else servo.linear
        axes.append(
            Axis(
                name=name,
                label=words[direction],
                unit="rad/s" if turns else "m/s",
                minimum=-fastest,
                maximum=fastest,
                slew=fastest / SLEW_TIME,
                brake=brake_for(None, fastest, hold, ()),
            )
        )
    return tuple(axes)


def _joints(settings: Ros2Settings) -> tuple[Joint, ...]:
    base: tuple[Joint, ...] = ()
    if settings.base is not None:
        base = tuple(Joint(name=name, unit="rad" if name == "base.yaw" else "m") for name in BASE_JOINTS)
    if settings.servo is not None:
        return base + tuple(Joint(name=name, unit="rad") for name in settings.servo.joints)
    arm = () if settings.arm is None else settings.arm.joints
    return base + tuple(
        Joint(name=joint.name, unit=joint.unit, minimum=joint.lower, maximum=joint.upper) for joint in arm
    )


def _position_limit(joint: ArmJoint) -> PositionLimit | None:
    if joint.lower is None and joint.upper is None:
        return None
    return PositionLimit(
        name=f"{joint.name}.range",
        label=f"{joint.label or joint.name} range",
        joint=joint.name,
        minimum=joint.lower,
        maximum=joint.upper,
        axes=(AxisGain(axis=f"arm.{joint.name}"),),
        margin=joint.margin,
        latency=joint.latency,
    )


def _planar_base(base: Base) -> PlanarBase:
    x, y, yaw = BASE_JOINTS
    return PlanarBase(
        x=x,
        y=y,
        yaw=yaw,
        forward="base.vx",
        left="base.vy" if base.left else "",
        turn="base.wz" if base.turn else "",
        radius=base.radius,
        margin=base.margin,
        latency=base.latency,
    )


def _check_readings(settings: Ros2Settings, names: list[str]) -> None:
    """Raises SettingsPlace: a reading has the name of another item, or a kind or a limit that it cannot have."""
    taken = {*names, *OWN_ITEMS, *(f"calibration_{camera.name}" for camera in settings.cameras)}
    for number, reading in enumerate(settings.readings):
        place = ("readings", number)
        if reading.name in (*taken, *(each.name for each in settings.readings[:number])):
            raise SettingsPlace((*place, "name"), f"{reading.name!r} is the name of another item of the status")
        kind = kind_of_reading(reading)
        if kind not in KINDS.get(reading.message, NUMBERS):
            raise SettingsPlace((*place, "kind"), f"a {reading.message} is no {kind}")
        if kind not in NUMBERS and (reading.warning is not None or reading.error is not None or reading.unit):
            raise SettingsPlace(place, f"a {kind} has no unit and no limits")
        warning, error = reading.warning, reading.error
        for key, bound in (("warning", warning), ("error", error)):
            if bound is not None and not math.isfinite(bound):
                raise SettingsPlace((*place, key), "a limit is a number")
        if warning is not None and error is not None and error < warning:
            raise SettingsPlace((*place, "error"), "it is below the warning")


def _base_body(base: Base) -> Body:
    """Return a disc with a mark at its front, at the pose of the odometry."""
    radius = max(base.radius, 0.05)
    x, y, yaw = BASE_JOINTS
    return Body(
        name=BASE_BODY,
        parent="",
        joints=(
            BodyJoint(joint=x, kind="prismatic", axis=(1, 0, 0)),
            BodyJoint(joint=y, kind="prismatic", axis=(0, 1, 0)),
            BodyJoint(joint=yaw, kind="revolute", axis=(0, 0, 1)),
        ),
        geoms=(
            Geom(shape="cylinder", size=(radius, radius / 2, 0), position=(0, 0, radius / 2), rgba=_COLOUR),
            Geom(
                shape="box",
                size=(radius / 3, radius / 10, radius / 20),
                position=(radius / 2, 0, radius * 1.05),
                rgba=(0.95, 0.95, 0.95, 1),
            ),
        ),
    )


def _sensor_body(settings: Ros2Settings, body: str | None) -> str:
    if body is not None:
        return body
    return "" if settings.base is None else BASE_BODY


def _ranges(settings: Ros2Settings) -> RangeRing | None:
    ring = settings.ranges
    if ring is None:
        return None
    if ring.range_min >= ring.range_max:
        raise SettingsPlace(("ranges", "range_min"), "must be below range_max")
    return RangeRing(
        name="ranges",
        body=_sensor_body(settings, ring.body),
        count=ring.count,
        angle_min=-math.pi,
        angle_increment=math.tau / ring.count,
        range_min=ring.range_min,
        range_max=ring.range_max,
    )


def _wrench(settings: Ros2Settings) -> WrenchSensor | None:
    sensor = settings.wrench
    if sensor is None:
        return None
    return WrenchSensor(
        name="wrench",
        body=_sensor_body(settings, sensor.body),
        threshold_force=sensor.threshold_force,
        full_scale_force=sensor.full_scale_force,
        full_scale_torque=sensor.full_scale_torque,
    )
