"""The kinds of messages that a robot's file knows, by their ROS names."""

__all__ = [
    "COMMANDS",
    "COMPRESSED",
    "DESCRIPTION",
    "FLOATS",
    "IMAGE",
    "INT8",
    "JOINT_STATE",
    "ODOMETRY",
    "SCAN",
    "SENSORS",
    "SERVO_COMMAND_TYPE",
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

COMMANDS = (TWIST_STAMPED, TWIST, TRAJECTORY, FLOATS)
SENSORS = (ODOMETRY, JOINT_STATE, SCAN, WRENCH, IMAGE, COMPRESSED)

SERVO_COMMAND_TYPE = "moveit_servo.command_in_type"  # a parameter of MoveIt Servo: what the numbers of a twist mean
