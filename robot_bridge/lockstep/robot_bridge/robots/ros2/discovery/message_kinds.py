"""The kinds of messages that a robot's file knows, by their ROS names."""

__all__ = [
    "BATTERY",
    "CAMERA_INFO",
    "COMMANDS",
    "COMPRESSED",
    "DESCRIPTION",
    "DIAGNOSTICS",
    "FLOATS",
    "FRAMES",
    "GRID",
    "GRIPPER",
    "IMAGE",
    "INT8",
    "JOINT_STATE",
    "KEPT",
    "NAVIGATE",
    "ODOMETRY",
    "PATH",
    "POSE",
    "POSE_COVARIANCE",
    "SCAN",
    "SENSORS",
    "SERVO_COMMAND_TYPE",
    "SERVICES",
    "SERVO_STATUS",
    "TRAJECTORY",
    "TWIST",
    "TWIST_STAMPED",
    "WRENCH",
]

TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
TWIST = "geometry_msgs/msg/Twist"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
FLOATS = "std_msgs/msg/Float64MultiArray"
ODOMETRY = "nav_msgs/msg/Odometry"
JOINT_STATE = "sensor_msgs/msg/JointState"
SCAN = "sensor_msgs/msg/LaserScan"
WRENCH = "geometry_msgs/msg/WrenchStamped"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
SERVO_STATUS = "moveit_msgs/msg/ServoStatus"
INT8 = "std_msgs/msg/Int8"
DESCRIPTION = "std_msgs/msg/String"
GRID = "nav_msgs/msg/OccupancyGrid"
PATH = "nav_msgs/msg/Path"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
BATTERY = "sensor_msgs/msg/BatteryState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
FRAMES = "tf2_msgs/msg/TFMessage"
GRIPPER = "control_msgs/action/GripperCommand"
NAVIGATE = "nav2_msgs/action/NavigateToPose"
SERVICES = ("std_srvs/srv/Trigger", "std_srvs/srv/SetBool")

COMMANDS = (TWIST_STAMPED, TWIST, TRAJECTORY, FLOATS)
SENSORS = (ODOMETRY, JOINT_STATE, SCAN, WRENCH, IMAGE, COMPRESSED, GRID, BATTERY, CAMERA_INFO)
KEPT = (GRID,)  # whose newest message is usually kept for those that come later

SERVO_COMMAND_TYPE = "moveit_servo.command_in_type"  # a parameter of MoveIt Servo: what the numbers of a twist mean
