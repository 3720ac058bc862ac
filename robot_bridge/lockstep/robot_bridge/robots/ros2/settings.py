"""The settings in the YAML file of a ROS 2 robot. docs/ros2.md explains them to users."""

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from lockstep.protocol.description import Body, CameraCalibration, ControlLayer, Geofence, Vector3

__all__ = [
    "ActionField",
    "Arm",
    "ArmCommand",
    "ArmJoint",
    "Base",
    "BaseAxis",
    "Battery",
    "CameraTopic",
    "Diagnostics",
    "Reading",
    "kind_of_reading",
    "Gripper",
    "JointStates",
    "MapGoal",
    "MapPlace",
    "MapTopics",
    "Odometry",
    "Ranges",
    "RosAction",
    "Ros2Settings",
    "Service",
    "Servo",
    "ServoStatus",
    "Tool",
    "ToolObstacle",
    "TwistCommand",
    "Wrench",
]

Name = Annotated[str, Meta(min_length=1, max_length=100)]
MAX_LABEL = 200  # characters
Topic = Annotated[str, Meta(pattern=r"^[~/A-Za-z_][A-Za-z0-9_/]*$", max_length=200)]
InterfaceType = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_]*/(action/)?[A-Z][A-Za-z0-9]*$", max_length=200)]
FieldPath = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*$", max_length=200)]
MaybeFieldPath = Annotated[str, Meta(pattern=r"^([a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*)?$", max_length=200)]
MaybeTopic = Annotated[str, Meta(pattern=r"^([~/A-Za-z_][A-Za-z0-9_/]*)?$", max_length=200)]
Positive = Annotated[float, Meta(gt=0, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0, le=1e6)]
Timeout = Annotated[float, Meta(gt=0, le=10)]
Rate = Annotated[float, Meta(ge=1, le=100)]


class TwistCommand(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic = "/cmd_vel"
    message: Literal["TwistStamped", "Twist"] = "TwistStamped"
    frame: str = "base_link"  # frame_id of TwistStamped
    rate: Rate = 50.0  # Hz, of repeats while a command is held


class Odometry(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic = "/odom"
    timeout: Timeout = 0.5  # s without a new message until the base must not move
    still: NotNegative = 0.01  # m/s and rad/s, below which the base counts as at rest


class BaseAxis(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    maximum: Positive  # m/s or rad/s
    minimum: float | None = None  # None: -maximum
    slew: Positive | None = None  # per second while driving; None: maximum in half a second
    brake: Positive | None = None  # per second to rest; None: maximum in half of `hold`


class Base(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A mobile base that takes twists and reports its pose."""

    forward: BaseAxis
    left: BaseAxis | None = None
    turn: BaseAxis | None = None
    command: TwistCommand = field(default_factory=TwistCommand)
    odometry: Odometry = field(default_factory=Odometry)
    radius: NotNegative = 0.3  # m, of the circle that holds the robot: drawn, and kept out of geofences
    margin: NotNegative = 0.05  # m kept from geofences besides
    latency: Annotated[float, Meta(ge=0, le=1)] = 0.1  # s that odometry may be late


class ArmCommand(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic = "/joint_trajectory_controller/joint_trajectory"
    message: Literal["JointTrajectory", "JointState", "Float64MultiArray"] = "JointTrajectory"
    interface: Literal["velocity", "position"] = "velocity"  # what the numbers of a Float64MultiArray are
    rate: Rate = 25.0  # Hz
    horizon: Annotated[float, Meta(ge=0.02, le=0.5)] = 0.1  # s ahead that each trajectory ends
    lead: Annotated[float, Meta(gt=0, le=5)] = 0.5  # s at full speed that the setpoint may be ahead of the arm


class JointStates(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic = "/joint_states"
    timeout: Timeout = 0.5
    still: NotNegative = 0.01  # rad/s or m/s


class ArmJoint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    name: Name  # as in JointState.name
    label: str = ""  # "": the name
    unit: Literal["rad", "m"] = "rad"
    maximum: Positive  # rad/s or m/s
    slew: Positive | None = None
    brake: Positive | None = None
    lower: float | None = None  # position limits that the bridge keeps, rad or m
    upper: float | None = None
    margin: NotNegative = 0.0
    latency: Annotated[float, Meta(ge=0, le=1)] = 0.1
    reach: Positive | None = None  # rad or m that a goal may be ahead of the joint; None: 0.5 rad, 0.1 m
    grips: bool = False  # a gripper: what it holds keeps it from its goal


class ToolObstacle(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the arm keeps off: a plane, or a box if it has a size. In the frame of what the arm stands on."""

    name: Name  # as in "the arm is close to …"
    position: Vector3 = (0.0, 0.0, 0.0)  # m, of a place on the plane, or of the box' middle
    normal: Vector3 = (0.0, 0.0, 1.0)  # from the plane to the arm
    size: tuple[Positive, Positive, Positive] | None = None  # m, along x, y and z


class Tool(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A tool that is driven by its pose, through inverse kinematics."""

    tip: Name  # a body, or a link of the URDF
    point: Vector3 = (0.0, 0.0, 0.0)  # m, of the tool in the tip's frame
    frame: Annotated[str, Meta(max_length=64)] = ""  # a camera with a calibration; "": of what the arm stands on
    linear: Positive | None = None  # m/s, the fastest along x, y and z; None: by the arm's length, at most 0.25
    posture: Annotated[tuple[float, ...], Meta(max_length=64)] = ()  # of the joints, where the tool's rotation is zero
    obstacles: Annotated[tuple[ToolObstacle, ...], Meta(max_length=8)] = ()
    keeps: Literal["position", "rotation"] = "position"  # where it cannot have both


class Arm(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An arm (or gripper, lift …) whose joints are driven by their velocities, or by goals."""

    goals: bool = False  # each axis is the place where a joint is to be
    tool: Tool | None = None  # its pose is driven, or the joints' goals
    poses: Annotated[dict[Name, tuple[float, ...]], Meta(max_length=12)] = {}  # of all joints; each is an action
    joints: Annotated[tuple[ArmJoint, ...], Meta(min_length=1, max_length=64)]
    command: ArmCommand = field(default_factory=ArmCommand)
    states: JointStates = field(default_factory=JointStates)


class ServoStatus(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What MoveIt Servo says of itself, shown as a fault while it is not well."""

    topic: Topic = "/servo_node/status"
    message: Literal["ServoStatus", "Int8"] = "ServoStatus"  # Int8: before ROS 2 Jazzy
    timeout: Timeout = 1.0


class ServoCommand(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic = "/servo_node/delta_twist_cmds"
    frame: str = "base_link"  # frame_id: the axes of the twist
    rate: Rate = 50.0  # Hz


class Servo(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An arm whose tool is driven by twists: MoveIt Servo, or another node that turns them into joint motion."""

    linear: Positive  # m/s, the fastest along x, y and z
    angular: Positive  # rad/s, the fastest about x, y and z
    joints: Annotated[tuple[Name, ...], Meta(min_length=1, max_length=64)]  # as in JointState: measured, shown
    command: ServoCommand = field(default_factory=ServoCommand)
    states: JointStates = field(default_factory=JointStates)
    status: ServoStatus | None = None


class Ranges(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A LaserScan, gathered into `count` sectors all around; each shows the nearest distance in it."""

    topic: Topic = "/scan"
    timeout: Timeout = 1.0
    body: str | None = None  # the body that it sits on; None: the base, or the world without one
    yaw: float = 0.0  # rad, of the scanner's frame in the body's
    frame: str = ""  # the body's frame, "base_link": TF says where the scanner is in it, not `yaw`; "": `yaw` does
    count: Annotated[int, Meta(ge=3, le=720)] = 72
    range_min: NotNegative = 0.05  # m
    range_max: Positive = 10.0


class Wrench(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    topic: Topic
    timeout: Timeout = 0.5
    body: str | None = None
    threshold_force: NotNegative = 2.0  # N
    full_scale_force: Positive = 50.0
    full_scale_torque: Positive = 10.0  # N m


class CameraTopic(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pictures from one topic."""

    name: Name
    label: str = ""
    topic: Topic
    message: Literal["Image", "CompressedImage"] = "Image"
    width: Annotated[int, Meta(ge=16, le=8192)]
    height: Annotated[int, Meta(ge=16, le=8192)]
    frame_rate: Annotated[float, Meta(ge=0.1, le=120)] = 15.0  # Hz; further pictures are left out
    captured: Literal["header", "arrival"] = "header"  # source of the time of capture
    latency: Annotated[float, Meta(ge=0, le=5)] = 0.0  # s, taken off that time besides
    timeout: Timeout = 2.0
    calibration: CameraCalibration | None = None  # None: not known, nothing is drawn on the pictures
    info: MaybeTopic = ""  # of sensor_msgs/CameraInfo, compared with the calibration; "": nothing is compared


class Battery(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A sensor_msgs/BatteryState topic, shown in the robot's status."""

    topic: Topic = "/battery_state"
    name: Name = "battery"
    label: Annotated[str, Meta(max_length=MAX_LABEL)] = "Battery"
    timeout: Annotated[float, Meta(gt=0, le=600)] = 10.0  # s; then the console marks the reading as old
    low: Annotated[float, Meta(ge=0, le=1)] = 0.2  # below it the level is a warning
    empty: Annotated[float, Meta(ge=0, le=1)] = 0.05  # below it an error


class Diagnostics(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A diagnostic_msgs/DiagnosticArray topic, shown in the robot's status."""

    topic: Topic = "/diagnostics"
    timeout: Annotated[float, Meta(gt=0, le=600)] = 10.0  # s, as for a battery; a silent component is shown as old
    most: Annotated[int, Meta(ge=1, le=40)] = 12  # components that are shown at once, the worst first


ReadingKind = Literal["mode", "text", "switch", "number", "temperature"]
NUMBERS: tuple[ReadingKind, ...] = ("number", "temperature")
KINDS: dict[str, tuple[ReadingKind, ...]] = {  # by message, the usual one first; of the others they are numbers
    "String": ("mode", "text"),
    "Bool": ("switch",),
    "Temperature": ("temperature", "number"),
}


class Reading(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A topic with one value, shown in the robot's status: the `data` of std_msgs, or a sensor_msgs/Temperature."""

    topic: Topic
    name: Name
    message: Literal["String", "Bool", "Float32", "Float64", "Int32", "Temperature"] = "String"
    kind: ReadingKind | Literal[""] = ""  # "": by the message, a String is a mode
    label: Annotated[str, Meta(max_length=MAX_LABEL)] = ""  # "": the name
    unit: Annotated[str, Meta(max_length=16)] = ""  # of a number; "" for a temperature: °C
    timeout: Annotated[float, Meta(gt=0, le=600)] = 10.0  # s; then the console marks the reading as old
    warning: float | None = None  # above it the level is a warning; of a number or a temperature
    error: float | None = None  # above it an error


def kind_of_reading(reading: Reading) -> ReadingKind:
    """Return what a reading is shown as."""
    return reading.kind or KINDS.get(reading.message, NUMBERS)[0]


class Service(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A service that becomes an action of the robot. It must move nothing: see docs/ros2.md."""

    name: Name
    service: Topic
    type: Literal["Trigger", "SetBool"] = "Trigger"  # of std_srvs
    label: str = ""  # "": the name
    confirm: str = ""  # question that a console asks first
    timeout: Annotated[float, Meta(gt=0, le=600)] = 10.0  # s for the answer


class ActionField(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A parameter of an action, which is a field of its goal."""

    field: FieldPath  # in the goal, "order" or "target.speed"
    name: str = ""  # "": the field
    label: str = ""  # "": the name
    kind: Literal["number", "choice", "switch"] = "number"
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: Annotated[tuple[str, ...], Meta(max_length=32)] = ()
    default: bool | float | str | None = None


class RosAction(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A ROS 2 action that becomes an action of the robot. docs/ros2.md says when it is cancelled."""

    name: Name
    action: Topic  # name of the action server
    type: InterfaceType  # "nav2_msgs/DockRobot"
    label: str = ""  # "": the name
    moves: bool = True
    confirm: str = ""
    goal: dict[FieldPath, bool | float | str] = {}  # fields of the goal that are always the same
    parameters: Annotated[tuple[ActionField, ...], Meta(max_length=8)] = ()
    left: MaybeFieldPath = ""  # number in the feedback that goes to 0 until the goal is reached
    progress: MaybeFieldPath = ""  # number in the feedback that goes from 0 to 1
    text: MaybeFieldPath = ""  # field of the feedback that is shown while it runs
    result: MaybeFieldPath = ""  # field of the result that is shown at the end
    timeout: Annotated[float, Meta(gt=0, le=60)] = 5.0  # s for the server to accept a goal, or to end a cancelled one


class Gripper(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A control_msgs/GripperCommand action: its opening is the parameter of an action of the robot."""

    name: Name = "gripper"
    label: str = "Gripper"
    action: Topic = "/gripper_controller/gripper_cmd"
    closed: float = 0.0  # position, m or rad as the controller takes it
    open: float
    effort: NotNegative = 0.0  # the most, N or N m; 0: as the controller likes
    unit: Literal["m", "rad"] = "m"
    timeout: Annotated[float, Meta(gt=0, le=60)] = 5.0


class MapPlace(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the bridge knows where the frame of the odometry is on the map."""

    source: Literal["tf", "topic", "same"] = "tf"  # same: the odometry is in the map's frame
    topic: Topic = "/amcl_pose"  # the robot's pose on the map
    message: Literal["PoseWithCovarianceStamped", "PoseStamped"] = "PoseWithCovarianceStamped"
    odometry: str = "odom"  # frame_id of the odometry, for tf
    timeout: Annotated[float, Meta(gt=0, le=3600)] = 10.0  # s after which the place counts as not known


class MapGoal(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The action that drives the robot to a pose on the map."""

    action: Topic = "/navigate_to_pose"
    type: InterfaceType = "nav2_msgs/NavigateToPose"
    pose: FieldPath = "pose"  # field of the goal, a geometry_msgs/PoseStamped
    left: MaybeFieldPath = "distance_remaining"  # m, in the feedback
    result: MaybeFieldPath = ""
    label: str = "Go to"
    timeout: Annotated[float, Meta(gt=0, le=60)] = 5.0


class MapTopics(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The map of a base: what it is drawn from, and how the base is sent to a place on it."""

    topic: Topic = "/map"  # nav_msgs/OccupancyGrid
    durable: bool = True  # its publisher keeps the newest for subscribers that come later
    frame: Name = "map"
    place: MapPlace = field(default_factory=MapPlace)
    path: MaybeTopic = "/plan"  # nav_msgs/Path
    goal: MapGoal | None = None


class Lockout(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A std_msgs/Bool topic: true keeps everybody from driving, and so does silence for longer than `timeout`."""

    topic: Topic
    timeout: Timeout = 1.0
    hardware_stop: bool = False  # it is a hardware stop of the robot, and the status shows whether it is pressed


class Ros2Settings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    name: Name
    label: str = ""
    domain: Annotated[int, Meta(ge=0, le=232)] | None = None  # None: ROS_DOMAIN_ID
    node: Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] = "lockstep"
    namespace: Annotated[str, Meta(pattern=r"^(/?[A-Za-z_][A-Za-z0-9_/]*)?$")] = ""
    use_sim_time: bool = False
    hold: Annotated[float, Meta(gt=0, le=5)] = 0.5  # s
    watchdog: Annotated[float, Meta(gt=0, lt=5)] | None = None  # s, less than hold; None: 0.1, or half of hold
    max_event_age: Annotated[float, Meta(gt=0, le=10)] = 2.0  # s
    max_event_rate: Annotated[float, Meta(gt=0, le=100)] = 25.0  # Hz
    base: Base | None = None
    arm: Arm | None = None
    servo: Servo | None = None  # instead of `arm`
    ranges: Ranges | None = None
    wrench: Wrench | None = None
    lockout: Lockout | None = None
    batteries: Annotated[tuple[Battery, ...], Meta(max_length=8)] = ()
    diagnostics: Diagnostics | None = None
    readings: Annotated[tuple[Reading, ...], Meta(max_length=16)] = ()
    services: Annotated[tuple[Service, ...], Meta(max_length=32)] = ()
    actions: Annotated[tuple[RosAction, ...], Meta(max_length=32)] = ()
    grippers: Annotated[tuple[Gripper, ...], Meta(max_length=4)] = ()
    map: MapTopics | None = None  # needs a base
    cameras: Annotated[tuple[CameraTopic, ...], Meta(max_length=8)] = ()
    geofences: Annotated[tuple[Geofence, ...], Meta(max_length=32)] = ()
    urdf: Annotated[str, Meta(max_length=1000)] = ""  # a file, beside this one; gives `bodies` and limits of joints
    bodies: tuple[Body, ...] = ()  # of the kinematic model, besides the base
    layers: tuple[ControlLayer, ...] = ()  # replace those that are made for the axes
