"""The robot description: all that a console needs to know to drive a robot it has never seen.

Units are SI; angles in radians; frames and signs follow ROS REP 103 (x forward, y left, z up).
"""

from typing import Literal

import msgspec

__all__ = [
    "Action",
    "ActionParameter",
    "Axis",
    "AxisGain",
    "Binding",
    "Body",
    "BodyJoint",
    "BodyTwist",
    "Camera",
    "ControlLayer",
    "ForceFeeling",
    "Geofence",
    "Geom",
    "Joint",
    "MapView",
    "Microphone",
    "PadInput",
    "PlanarBase",
    "Pose",
    "PositionLimit",
    "RangeRing",
    "RobotDescription",
    "StartWarning",
    "TouchPad",
    "WrenchSensor",
]

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z
Rgba = tuple[float, float, float, float]  # 0 to 1 each

PadInput = Literal["left_x", "left_y", "right_x", "right_y", "dpad_x", "dpad_y", "triggers"]
TouchPad = Literal["left_x", "left_y", "right_x", "right_y"]


class Axis(msgspec.Struct, frozen=True, kw_only=True):
    """One value of a command, in physical units.

    The value of a rate axis says how fast to move; `rest` means "do not move". The value of a goal axis says where to
    be; null means "do not move", and the axis stays where it was when rest began (docs/robot-link.md, "Goal axes").
    """

    name: str  # "base.vx"
    label: str  # "Forward"
    unit: str  # "m/s"
    minimum: float
    maximum: float
    slew: float  # unit/s, largest change per second while driving; of a goal axis its largest speed
    brake: float  # unit/s, change per second when coming to rest (hold ended, rest, stop); of a goal axis unit/s^2
    rest: float = 0.0  # the value of a rate axis that means "do not move"
    kind: Literal["rate", "goal"] = "rate"
    acceleration: float = 0.0  # unit/s^2, of a goal axis that is driven; 0: as `brake`
    reach: float = 0.0  # unit, of a goal axis: how far from the measured value a goal may be
    wrap: float | None = None  # unit, of a goal axis that turns on and on: its period; None: it does not
    grips: bool = False  # a goal axis that squeezes: what it holds keeps it from its goal


class Joint(msgspec.Struct, frozen=True, kw_only=True):
    """One measured joint position, in the order of `Feedback.joints`."""

    name: str
    unit: Literal["rad", "m"]
    minimum: float | None = None
    maximum: float | None = None


class AxisGain(msgspec.Struct, frozen=True, kw_only=True):
    """An axis that moves a joint: the joint's velocity is `gain` x (the axis' value - its rest value).

    None: the gain changes with the posture, and the robot adapter computes the axes' effect on the joint.
    """

    axis: str
    gain: float | None = 1.0


class PositionLimit(msgspec.Struct, frozen=True, kw_only=True):
    """Keeps a measured joint between `minimum` and `maximum` by slowing the axes that move it; None: no bound.

    The bridge enforces it (docs/robot-link.md, "Limits"). Motion away from a bound is always free.
    """

    name: str  # "lift.range", what `Feedback.limits` says while it acts
    label: str  # "Lift range"
    joint: str
    minimum: float | None = None
    maximum: float | None = None
    axes: tuple[AxisGain, ...]
    margin: float = 0.0  # rad or m of further distance, for the robot's own dynamics
    latency: float = 0.0  # s that the measured position may be late, besides one tick


class PlanarBase(msgspec.Struct, frozen=True, kw_only=True):
    """A mobile base on a plane: where its pose is measured, and which axes move it. The geofences need it."""

    x: str  # joints: the pose in the frame of the geofences, m and rad
    y: str
    yaw: str
    forward: str  # axes: twist in the base's own frame, m/s and rad/s
    left: str = ""  # "" for a base that cannot move sideways
    turn: str = ""
    radius: float = 0.0  # m, of the circle around the pose's origin that holds the whole robot
    margin: float = 0.0  # m kept besides
    latency: float = 0.0  # s that the measured pose may be late, besides one tick


class Geofence(msgspec.Struct, frozen=True, kw_only=True):
    """A zone on the floor that the whole base stays inside of, or outside of."""

    name: str  # "charger", what `Feedback.limits` says while it acts
    label: str  # "Charging area"
    kind: Literal["keep_in", "keep_out"]
    polygon: tuple[Vector2, ...]  # m, corners in order, either way round; may be concave


class WrenchSensor(msgspec.Struct, frozen=True, kw_only=True):
    """A force and torque sensor; `full_scale_force` is the force that is felt and drawn as "all there is"."""

    name: str
    body: str  # name of the kinematic body it sits on
    threshold_force: float  # N, below it nothing is felt
    full_scale_force: float  # N
    full_scale_torque: float  # N m


class ForceFeeling(msgspec.Struct, frozen=True, kw_only=True):
    """How a contact feels to the operator: rumble and tone by newtons. Without it, by the wrench sensor's own range.

    Of the force between the two, as a share from 0 to 1, `curve` is the exponent: below 1 light contacts are felt more.
    """

    threshold_newtons: float  # N, up to it nothing is felt
    full_newtons: float  # N, from it on it is felt at its strongest
    curve: float = 1.0


class RangeRing(msgspec.Struct, frozen=True, kw_only=True):
    """Range sensors in a plane, with the field names of sensor_msgs/LaserScan."""

    name: str
    body: str
    count: int
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float


class CameraCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The pinhole of a camera, for its full size, and where it is; terms of sensor_msgs/CameraInfo.

    The pose is that of the optical frame of ROS REP 103: x right and y down in the picture, z into it.
    """

    fx: float  # pixels, focal lengths
    fy: float
    cx: float  # pixels, principal point
    cy: float
    distortion_model: str = ""  # "plumb_bob", "rational_polynomial", "equidistant"; "": no distortion
    distortion: tuple[float, ...] = ()
    body: str = ""  # that it is fixed to; "" for the world
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)


class Camera(msgspec.Struct, frozen=True, kw_only=True):
    name: str
    label: str
    width: int
    height: int
    frame_rate: float  # Hz
    metres_per_pixel: float | None = None  # m, of a camera that looks at one plane: a scale bar; None: it has no scale
    # Action that a click on the picture asks for. Its number parameters are "x" and "y", shares of the picture from the
    # left and from the top, and "event", the stamp of the picture that was clicked on. "": none.
    click: str = ""
    calibration: CameraCalibration | None = None  # None: not known


class Microphone(msgspec.Struct, frozen=True, kw_only=True):
    name: str
    label: str
    sample_rate: int  # Hz
    channels: int = 1


class Geom(msgspec.Struct, frozen=True, kw_only=True):
    """A shape for the 3D view.

    `size`: box: half extents; sphere: (radius, 0, 0); cylinder and capsule: (radius, half length, 0); mesh: none.
    """

    shape: Literal["box", "sphere", "cylinder", "capsule", "mesh"]
    size: Vector3 = (0.0, 0.0, 0.0)
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    rgba: Rgba = (0.7, 0.7, 0.7, 1.0)
    vertices: tuple[float, ...] = ()  # m; of a mesh: x, y and z of each in turn
    triangles: tuple[int, ...] = ()  # of a mesh: numbers of three vertices each, counter-clockwise from outside


class BodyJoint(msgspec.Struct, frozen=True, kw_only=True):
    """How a body moves against its parent: the named entry of `RobotDescription.joints` about or along `axis`."""

    joint: str
    kind: Literal["revolute", "prismatic"]
    axis: Vector3


class Body(msgspec.Struct, frozen=True, kw_only=True):
    """A rigid body of the kinematic tree.

    Its joints act in list order, in the body's own frame, after `position` and `orientation`.
    """

    name: str
    parent: str  # "" for the world
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    joints: tuple[BodyJoint, ...] = ()
    geoms: tuple[Geom, ...] = ()


class BodyTwist(msgspec.Struct, frozen=True, kw_only=True):
    """Axes that together are the twist of a body, for the commanded pose in the 3D view; "" without such an axis."""

    body: str
    frame: str = ""  # the body in whose axes the twist is given; "" for the world
    point: Vector3 = (0.0, 0.0, 0.0)  # m, the point of the body that moves with `linear`, in its own frame
    linear: tuple[str, str, str] = ("", "", "")  # axes along x, y and z, m/s
    angular: tuple[str, str, str] = ("", "", "")  # axes about x, y and z, rad/s


class Pose(msgspec.Struct, frozen=True, kw_only=True):
    """Goal axes that together are the pose of a body: a position and a rotation vector, in the frame `frame`.

    They move the joints that the axes `instead_of` move too. A command drives the ones or the others.
    """

    name: str  # "tool"
    label: str
    body: str
    frame: str = ""  # body or camera in whose frame it is; "" for the world; a camera has x right, y down, z ahead
    point: Vector3 = (0.0, 0.0, 0.0)  # m, the point of the body that is at the position, in its own frame
    position: tuple[str, str, str]  # axes, m; "" without such an axis
    rotation: tuple[str, str, str] = ("", "", "")  # axes, rad
    instead_of: tuple[str, ...] = ()  # goal axes
    settling: float = 0.0  # s in which the robot may come nearer to goals that stand still and are pursued no more


class Binding(msgspec.Struct, frozen=True, kw_only=True):
    """What moves an axis. A positive input drives the axis up to `scale * maximum`, after `invert`."""

    axis: str
    pad: PadInput | None = None  # W3C standard mapping: left and up are negative; "triggers" is right minus left
    touch: TouchPad | None = None  # an on-screen stick: right and up are positive
    invert_pad: bool = False
    invert_touch: bool = False
    key_positive: str = ""  # KeyboardEvent.code, "KeyW"
    key_negative: str = ""
    scale: float = 1.0  # 0 to 1


class ControlLayer(msgspec.Struct, frozen=True, kw_only=True):
    """A set of bindings that are active together; the operator switches between layers."""

    name: str
    label: str
    bindings: tuple[Binding, ...]


class StartWarning(msgspec.Struct, frozen=True, kw_only=True):
    """A light or horn that warns people at the robot before its first motion. The bridge drives it."""

    seconds: float  # that it warns before a moving command may execute
    axis: str  # of the light or horn; a command that drives nothing else counts as neutral
    value: float  # that the axis is driven to while it warns


class ActionParameter(msgspec.Struct, frozen=True, kw_only=True):
    """A value that an action takes."""

    name: str
    label: str
    kind: Literal["number", "choice", "switch"]
    unit: str = ""  # of a number
    minimum: float | None = None  # of a number; None: no bound
    maximum: float | None = None
    choices: tuple[str, ...] = ()  # of a choice
    default: bool | float | str | None = None  # None: a request has to name a value


class Action(msgspec.Struct, frozen=True, kw_only=True):
    """A thing that the robot does when it is asked once (docs/robot-link.md, "Actions")."""

    name: str  # "home"
    label: str  # "Home"
    moves: bool = True  # it moves something: it lives only while armed events renew it
    parameters: tuple[ActionParameter, ...] = ()
    confirm: str = ""  # question that a console asks the person first; "": it asks none


class MapView(msgspec.Struct, frozen=True, kw_only=True):
    """The map on which the robot is shown (docs/robot-link.md, "Maps").

    The joints give the measured pose, in a frame whose place on the map `Navigation.frame` says.
    """

    x: str  # "base.x", m
    y: str  # "base.y", m
    yaw: str  # "base.yaw", rad
    radius: float = 0.3  # m, of the circle that stands for the robot
    # Action that drives to a place. Its number parameters "x" and "y" (m) and "yaw" (rad) are the pose in the map's
    # frame; without "yaw" the robot arrives as it likes. "": none.
    goal: str = ""


class RobotDescription(msgspec.Struct, frozen=True, kw_only=True):
    name: str  # "mobile-manipulator"
    label: str  # "Mobile manipulator"
    axes: tuple[Axis, ...]
    joints: tuple[Joint, ...] = ()
    layers: tuple[ControlLayer, ...] = ()
    cameras: tuple[Camera, ...] = ()  # the first is the main one
    microphones: tuple[Microphone, ...] = ()
    wrench: WrenchSensor | None = None
    ranges: RangeRing | None = None
    bodies: tuple[Body, ...] = ()
    position_limits: tuple[PositionLimit, ...] = ()
    planar_base: PlanarBase | None = None
    geofences: tuple[Geofence, ...] = ()
    force_feeling: ForceFeeling | None = None
    body_twists: tuple[BodyTwist, ...] = ()
    poses: tuple[Pose, ...] = ()
    start_warning: StartWarning | None = None
    actions: tuple[Action, ...] = ()
    map: MapView | None = None
    hold: float = 0.3  # s a command is held before the robot comes to rest without another
    watchdog: float | None = (
        None  # s without a tick after which the robot is brought to rest; None: see docs/robot-link.md
    )
    max_event_age: float = 2.0  # s after which a feedback may no longer be answered
    max_event_rate: float = 25.0  # Hz, the most events per second that the robot wants
