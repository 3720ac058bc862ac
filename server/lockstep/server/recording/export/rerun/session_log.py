"""One epoch of a session as a recording of Rerun. Everything lies on the timeline `event`, and on two of time."""

import math
from collections.abc import Sequence

import rerun as rr

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.export.rerun.bodies import BodyPaths, entity, log_bodies, log_cameras, moving
from lockstep.server.recording.export.rerun.columns import Columns, Moment
from lockstep.server.recording.export.rerun.further_records import FurtherRecords
from lockstep.server.recording.format.records import CommandRecord, Degraded, FeedbackRecord, OwnRecord
from lockstep.server.recording.format.records_in_words import in_words
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS
from lockstep.server.scene.kinematics import body_pose

__all__ = ["APPLICATION", "Moment", "SessionLog", "new_stream"]

APPLICATION = "lockstep"
DEGRADED = OWN_TOPICS[Degraded]
LOG = "/log"
JOINTS = "/joints"
MEASURED, COMMANDED, GOALS = "/axes/measured", "/axes/commanded", "/axes/goals"
FORCE, TORQUE = "/wrench/force", "/wrench/torque"
STOPPED, AT_REST = "/state/stopped", "/state/at_rest"
FAULTS, LIMITS, UNKNOWN = "/state/faults", "/state/limits", "/state/unknown"
DRIVER, DRIVER_KIND, INTERVENTION = "/driver", "/driver/kind", "/driver/intervention"
GAP = "gap"  # and the camera's name: feedback's event minus the picture's stamp, at the picture's arrival
CODECS = {"h264": rr.VideoCodec.H264, "vp8": rr.VideoCodec.VP8}
MOST_ROWS = 4000
MOST_BYTES = 8_000_000


def new_stream(recording: str, epoch: str) -> rr.RecordingStream:
    """Return a recording of Rerun; parts of one epoch have the same id, so that viewers join them."""
    return rr.RecordingStream(APPLICATION, recording_id=f"{recording}-{epoch}" if recording else epoch)


class SessionLog:
    """Takes the records of one epoch, in the order of their arrival. Used from one thread.

    Call `begin` first. Rows wait until `flush`, or until many wait. Sound is left out: Rerun has it as whole files
    only.

    Attributes:
        columns: the rows that wait
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self.columns = Columns(stream)
        self._further = FurtherRecords(stream, self.columns)
        self._stream = stream
        self._description = RobotDescription(name="", label="", axes=())
        self._paths = BodyPaths(self._description)
        self._event = 0  # of the newest feedback
        self._begun: set[str] = set()  # entities of the cameras that have given a picture
        self._whole: set[str] = set()  # cameras without a loss since their keyframe

    def begin(self, description: RobotDescription) -> None:
        """Log what is fixed of a robot: bodies, cameras, and the names of axes and joints."""
        if description == self._description:
            return
        self._description, self._paths = description, BodyPaths(description)
        self._stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log_bodies(self._stream, description, self._paths)
        log_cameras(self._stream, description.cameras, self._paths)
        axes = [axis.name for axis in description.axes]
        self._further.begin(description)
        named = {
            MEASURED: axes,
            COMMANDED: axes,
            GOALS: [axis.name for axis in description.axes if axis.kind == "goal"],
            JOINTS: [joint.name for joint in description.joints],
            FORCE: ["x", "y", "z"],
            TORQUE: ["x", "y", "z"],
        }
        for path, names in named.items():
            if names:
                self._stream.log(path, rr.SeriesLines(names=names), static=True)

    def own(self, record: OwnRecord, at: Moment) -> None:
        """Take one of Lockstep's own records."""
        match record:
            case FeedbackRecord():
                self._feedback(record, at, self._description, self._paths)
            case Degraded():
                self._whole.clear()
            case CommandRecord(outcome="forwarded"):
                self.columns.scalars(COMMANDED, at, _filled(record.values, len(self._description.axes)))
            case _:
                self._further.take(record, at)
        words = in_words(record)
        if words is not None:
            self.columns.text(LOG, at, words.text, warning=words.warning)
        self._make_room()

    def picture(self, camera: str, picture_format: str, picture: bytes, at: Moment, *, keyframe: bool) -> None:
        """Take a picture; it is left out where one that it builds on is missing.

        H.264: an access unit in Annex B, with parameter sets before each keyframe.
        """
        codec = CODECS.get(picture_format)
        if codec is None:
            return
        if keyframe:
            self._whole.add(camera)
        if camera not in self._whole:
            return  # it cannot be decoded
        path = self._paths.camera(camera)
        if picture_format != "h264":
            path += entity(picture_format)  # a stream of Rerun has one codec
        if path not in self._begun:
            self._begun.add(path)
            self._stream.log(path, rr.VideoStream(codec=codec), static=True)
        self.columns.picture(path, at, picture, keyframe=keyframe)
        if self._event:
            self.columns.scalars(entity(GAP, camera), at, [event_gap(self._event, at.event)])
        self._make_room()

    def leave_out(self, topic: str) -> None:
        """Leave a record of this topic out; pictures that build on it are left out until the next keyframe."""
        if topic == DEGRADED:
            self._whole.clear()
        else:
            self._whole.discard(topic.removeprefix(CAMERA))

    def flush(self) -> None:
        """Hand all rows to Rerun. Blocks while its sink has no room."""
        self.columns.send()

    def _make_room(self) -> None:
        if self.columns.waiting >= MOST_ROWS or self.columns.waiting_bytes >= MOST_BYTES:
            self.flush()

    def _feedback(self, record: FeedbackRecord, at: Moment, description: RobotDescription, paths: BodyPaths) -> None:
        self._event = record.event
        columns = self.columns
        columns.scalars(MEASURED, at, _filled(record.axes, len(description.axes)))
        goals = _filled(record.goals, len(description.axes))
        if any(axis.kind == "goal" for axis in description.axes):
            wanted = [goal for axis, goal in zip(description.axes, goals, strict=True) if axis.kind == "goal"]
            columns.scalars(GOALS, at, wanted)
        if description.joints:
            columns.scalars(JOINTS, at, _filled(record.joints, len(description.joints)))
        if description.wrench is not None and len(record.wrench) == 6:
            columns.scalars(FORCE, at, record.wrench[:3])
            columns.scalars(TORQUE, at, record.wrench[3:])
        columns.scalars(STOPPED, at, [float(record.stop.stopped)])
        columns.scalars(AT_REST, at, [float(record.at_rest)])
        self._driven(record, at)
        joints = dict(zip((joint.name for joint in description.joints), record.joints, strict=False))
        for body in moving(description):
            if body.name in paths.bodies:
                pose = body_pose(body, joints)
                columns.pose(paths.bodies[body.name], at, pose.position, pose.orientation)
        ring = description.ranges
        if ring is not None and record.ranges:
            angles = (ring.angle_min + ring.angle_increment * number for number in range(len(record.ranges)))
            seen = [
                (distance * math.cos(angle), distance * math.sin(angle), 0.0)
                for angle, distance in zip(angles, record.ranges, strict=True)
                if math.isfinite(distance) and ring.range_min <= distance < ring.range_max
            ]
            columns.points(f"{paths.bodies.get(ring.body, '')}{entity('ranges')}", at, seen)

    def _driven(self, record: FeedbackRecord, at: Moment) -> None:
        kind = "" if record.driver_kind == "none" else record.driver_kind
        self._further.state(DRIVER, at, record.driver if kind else "")
        self._further.state(DRIVER_KIND, at, kind)
        self.columns.scalars(INTERVENTION, at, [float(record.intervention)])
        for path, names in ((FAULTS, record.faults), (LIMITS, record.limits), (UNKNOWN, record.unknown)):
            self._further.state(path, at, ", ".join(names))


def _filled(values: Sequence[float | None], count: int) -> list[float]:
    """Return `count` numbers; NaN where there is none, such as for a goal axis that stays."""
    known = [math.nan if value is None else value for value in values[:count]]
    return [*known, *[math.nan] * (count - len(known))]
