"""Messages in Foxglove's schemas, as bytes. No I/O, no clock; times in ns since 1970."""

import math
from collections.abc import Iterator

from foxglove_schemas_protobuf.CompressedAudio_pb2 import CompressedAudio
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.format.own_messages import AxisCommands, AxisStates, WrenchStamped
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord
from lockstep.server.recording.format.robot_frames import (
    WORLD,
    camera_calibration,
    fixed_transforms,
    moving_transforms,
    odometry,
    robot_shapes,
)
from lockstep.server.recording.format.topics import (
    AXIS_COMMANDS,
    AXIS_STATES,
    CALIBRATION,
    FIXED_TRANSFORMS,
    JOINTS,
    ODOMETRY,
    POSE,
    SCAN,
    SHAPES,
    TRANSFORMS,
    WRENCH,
    has_frames,
)
from lockstep.server.recording.writing.writer import Entry

__all__ = ["camera_message", "command_messages", "feedback_messages", "log_message", "robot_messages", "sound_message"]

SECOND = 1_000_000_000


def _stamp(time: int) -> Timestamp:
    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)


def camera_message(stream: str, captured: int, picture: bytes, picture_format: str = "h264") -> bytes:
    """Wrap one H.264 access unit in Annex B, or one frame of "vp8"."""
    found = CompressedVideo(timestamp=_stamp(captured), frame_id=stream, data=picture, format=picture_format)
    return found.SerializeToString()


def sound_message(sound_format: str, captured: int, packet: bytes) -> bytes:
    """Wrap a packet of "opus", or of "g711-ulaw": 8 kHz, mono."""
    return CompressedAudio(timestamp=_stamp(captured), data=packet, format=sound_format).SerializeToString()


def log_message(arrived: int, text: str, *, warning: bool = False) -> bytes:
    level = Log.WARNING if warning else Log.INFO
    return Log(timestamp=_stamp(arrived), level=level, message=text, name="lockstep").SerializeToString()


def robot_messages(description: RobotDescription, event: int, arrived: int) -> Iterator[Entry]:
    """Yield what is fixed of a robot in Foxglove's schemas: frames of cameras and of bodies without joints, shapes."""
    for camera in description.cameras:
        if camera.calibration is not None:
            data = camera_calibration(camera, camera.calibration, arrived)
            yield Entry(CALIBRATION + camera.name, event, arrived, arrived, data)
    if has_frames(description):
        yield Entry(FIXED_TRANSFORMS, event, arrived, arrived, fixed_transforms(description, arrived))
    if description.bodies:
        yield Entry(SHAPES, event, arrived, arrived, robot_shapes(description, arrived))


def command_messages(
    description: RobotDescription, command: CommandRecord, arrived: int, captured: int
) -> Iterator[Entry]:
    """Yield a command that went to the robot, with the names of its axes, for plots."""
    if command.outcome != "forwarded" or len(command.values) != len(description.axes):
        return
    axes = [
        {"name": axis.name, "value": value, "unit": axis.unit}
        for axis, value in zip(description.axes, command.values, strict=True)
    ]
    message = AxisCommands(
        timestamp=_stamp(captured),
        epoch=command.epoch,
        event=command.event,
        axes=axes,
        driver=command.name,
        speed=command.speed,
    )
    yield Entry(AXIS_COMMANDS, command.event, arrived, captured, message.SerializeToString())


def feedback_messages(
    description: RobotDescription, feedback: FeedbackRecord, arrived: int, captured: int
) -> Iterator[Entry]:
    """Yield a feedback in Foxglove's schemas, for programs that do not know Lockstep's own records."""
    stamp = _stamp(captured)

    def entry(topic: str, data: bytes) -> Entry:
        return Entry(topic, feedback.event, arrived, captured, data)

    if description.joints and len(feedback.joints) == len(description.joints):
        states = [
            JointState(name=joint.name, position=position)
            for joint, position in zip(description.joints, feedback.joints, strict=True)
        ]
        yield entry(JOINTS, JointStates(timestamp=stamp, joints=states).SerializeToString())
    if description.ranges is not None and feedback.ranges:
        ring = description.ranges
        scan = LaserScan(
            timestamp=stamp,
            frame_id=ring.body,
            pose=_pose(0.0, 0.0, 0.0),
            start_angle=ring.angle_min,
            end_angle=ring.angle_min + ring.angle_increment * (len(feedback.ranges) - 1),
            ranges=feedback.ranges,
        )
        yield entry(SCAN, scan.SerializeToString())
    joints = dict(zip((joint.name for joint in description.joints), feedback.joints, strict=False))
    if description.bodies:
        yield entry(TRANSFORMS, moving_transforms(description, joints, captured))
    base = description.planar_base
    if base is not None and {base.x, base.y, base.yaw} <= joints.keys():
        pose = _pose(joints[base.x], joints[base.y], joints[base.yaw])
        yield entry(POSE, PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose).SerializeToString())
        yield entry(ODOMETRY, odometry(description, base, pose, feedback.axes, captured))
    if description.wrench is not None and len(feedback.wrench) == 6:
        force, torque = feedback.wrench[:3], feedback.wrench[3:]
        wrench = WrenchStamped(
            timestamp=stamp,
            epoch=feedback.epoch,
            event=feedback.event,
            frame_id=description.wrench.body or WORLD,
            force=Vector3(x=force[0], y=force[1], z=force[2]),
            torque=Vector3(x=torque[0], y=torque[1], z=torque[2]),
        )
        yield entry(WRENCH, wrench.SerializeToString())
    if len(feedback.axes) == len(description.axes):
        yield entry(AXIS_STATES, _axis_states(description, feedback, stamp))


def _axis_states(description: RobotDescription, feedback: FeedbackRecord, stamp: Timestamp) -> bytes:
    goals = feedback.goals or [None] * len(description.axes)
    axes = [
        {"name": axis.name, "measured": measured, "goal": goal, "unit": axis.unit}
        for axis, measured, goal in zip(description.axes, feedback.axes, goals, strict=False)
    ]
    found = AxisStates(timestamp=stamp, epoch=feedback.epoch, event=feedback.event, axes=axes)
    return found.SerializeToString()


def _pose(x: float, y: float, yaw: float) -> Pose:
    turn = Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return Pose(position=Vector3(x=x, y=y, z=0.0), orientation=turn)
