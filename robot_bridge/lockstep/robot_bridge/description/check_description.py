"""Checks a robot's description: the bridge does so before it listens, and a client when it connects."""

import math
import unicodedata
from collections.abc import Iterable, Sequence

import msgspec

from lockstep.protocol.description import (
    Body,
    Camera,
    CameraCalibration,
    ControlLayer,
    ForceFeeling,
    Geofence,
    Microphone,
    Pose,
    PositionLimit,
    RangeRing,
    RobotDescription,
    StartWarning,
)
from lockstep.protocol.messages import MAX_AXES, MAX_RAYS
from lockstep.robot_bridge.description.check_actions import action_texts, check_actions
from lockstep.robot_bridge.description.check_axes import check_axes
from lockstep.robot_bridge.description.check_limits import check_limits
from lockstep.robot_bridge.description.check_maps import check_clicks, check_map
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["check_bounds", "check_description"]

MAX_STREAMS = 32  # cameras and microphones
MAX_BODIES = 1024
MAX_GEOMS = 4096
MAX_LAYERS = 32
MAX_LIMITS = 256
MAX_DISTORTION = 14  # coefficients, those of the longest model
FARTHEST = 1e6  # m, for drawn parts; the bound of their other numbers too
MAX_NAME = 200  # characters in a name or a label
MAX_BYTES = 60_000  # of JSON: a peer that declares no maximum takes messages of 65,536 bytes (RFC 8841 6.1)
# Coordinates of vertices, and corners of triangles. More cannot be in so many bytes: each takes two of them at least.
# Those of a robot's own meshes are longer, and MAX_BYTES is what bounds them.
MAX_MESH_NUMBERS = MAX_BYTES // 2
SIDES = range(1, 8193)  # pixels
FRAME_RATES = 240.0  # Hz
SAMPLE_RATES = range(8000, 192_001)  # Hz
CHANNELS = range(1, 9)
# Characters that end a line, command a terminal, or change the direction of the text around them.
_CONTROL = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def check_description(description: RobotDescription) -> None:
    """Check that a robot can be driven by this description.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    if not description.axes:
        raise DescriptionError("a robot needs at least one axis")
    check_bounds(description)
    _check_size(description)
    if not 0 < description.hold <= 5:
        raise DescriptionError(f"hold must be in (0, 5] s, not {description.hold}")
    if description.watchdog is not None and not 0 < description.watchdog < description.hold:
        raise DescriptionError(f"watchdog must be above 0 and less than hold, not {description.watchdog} s")
    if not 0 < description.max_event_age <= 10:
        raise DescriptionError(f"max_event_age must be in (0, 10] s, not {description.max_event_age}")
    if not 0 < description.max_event_rate <= 1000:
        raise DescriptionError(f"max_event_rate must be in (0, 1000] Hz, not {description.max_event_rate}")
    check_axes(description)
    _check_unique("axis", (axis.name for axis in description.axes))
    _check_unique("joint", (joint.name for joint in description.joints))
    _check_unique("body", (body.name for body in description.bodies))
    _check_unique(
        "stream", [camera.name for camera in description.cameras] + [source.name for source in description.microphones]
    )
    for camera in description.cameras:
        _check_camera(camera)
    for microphone in description.microphones:
        _check_microphone(microphone)
    if description.ranges is not None:
        _check_ranges(description.ranges)
    _check_bodies(description.bodies)
    _check_references(description)
    if description.force_feeling is not None:
        _check_feeling(description.force_feeling)
    if description.start_warning is not None:
        _check_warning(description, description.start_warning)
    check_actions(description.actions)
    check_clicks(description)
    check_map(description)
    check_limits(description)


def _check_size(description: RobotDescription) -> None:
    size = len(msgspec.json.encode(description))
    if size <= MAX_BYTES:
        return
    meshes = [(geom.vertices, geom.triangles) for body in description.bodies for geom in body.geoms]
    of_meshes = len(msgspec.json.encode([each for each in meshes if any(each)]))
    advice = "fewer geoms or shorter names"
    if of_meshes > size // 2:
        advice = f"fewer triangles, for the meshes have {of_meshes} of them"
    raise DescriptionError(f"{size} bytes of JSON, the bound is {MAX_BYTES}: {advice}")


def check_bounds(description: RobotDescription) -> None:
    """Check that a description can be shown: the counts of its parts, the size of its numbers, and its texts.

    That is enough for a description that drives no robot any more, such as a recording's; an older one may break newer
    rules.

    Raises:
        DescriptionError: names the first part that is too many, too long or cannot be printed.
    """
    _check_counts(description)
    _check_texts(description)
    _check_reach(description)


def _check_counts(description: RobotDescription) -> None:
    counts = (
        ("axes", len(description.axes), MAX_AXES),
        ("joints", len(description.joints), MAX_AXES),
        ("cameras and microphones", len(description.cameras) + len(description.microphones), MAX_STREAMS),
        ("bodies", len(description.bodies), MAX_BODIES),
        ("geoms", sum(len(body.geoms) for body in description.bodies), MAX_GEOMS),
        ("numbers of meshes", sum(map(_mesh_numbers, description.bodies)), MAX_MESH_NUMBERS),
        ("coefficients of distortion", max(map(_coefficients, description.cameras), default=0), MAX_DISTORTION),
        ("layers", len(description.layers), MAX_LAYERS),
        ("bindings", sum(len(layer.bindings) for layer in description.layers), MAX_GEOMS),
        ("position limits", len(description.position_limits), MAX_LIMITS),
        ("axes of position limits", sum(len(limit.axes) for limit in description.position_limits), MAX_GEOMS),
        ("geofences", len(description.geofences), MAX_LIMITS),
        ("corners of geofences", sum(len(fence.polygon) for fence in description.geofences), MAX_GEOMS),
        ("joints of bodies", sum(len(body.joints) for body in description.bodies), MAX_GEOMS),
        ("rays", 0 if description.ranges is None else description.ranges.count, MAX_RAYS),
        ("body twists", len(description.body_twists), MAX_LIMITS),
        ("poses", len(description.poses), MAX_LIMITS),
    )
    for kind, count, most in counts:
        if not 0 <= count <= most:
            raise DescriptionError(f"{count} {kind}, the bound is {most}")


def _mesh_numbers(body: Body) -> int:
    return sum(len(geom.vertices) + len(geom.triangles) for geom in body.geoms)


def _check_meshes(body: Body) -> None:
    for geom in body.geoms:
        vertices, left = divmod(len(geom.vertices), 3)
        if geom.shape != "mesh":
            if geom.vertices or geom.triangles:
                raise DescriptionError(f"body {body.name}: a {geom.shape} has no vertices and no triangles")
        elif not geom.triangles or left or len(geom.triangles) % 3:
            raise DescriptionError(f"body {body.name}: a mesh has three numbers for each vertex and each triangle")
        elif not all(0 <= number < vertices for number in geom.triangles):
            raise DescriptionError(f"body {body.name}: a triangle names a vertex that the mesh does not have")


def _coefficients(camera: Camera) -> int:
    return 0 if camera.calibration is None else len(camera.calibration.distortion)


def _check_reach(description: RobotDescription) -> None:
    """Check that drawn parts are within a bound: beyond it, computed numbers are not finite."""
    for body in description.bodies:
        _check_meshes(body)
        numbers = [*body.position, *body.orientation]
        for joint in body.joints:
            numbers += joint.axis
        for geom in body.geoms:
            numbers += (*geom.size, *geom.position, *geom.orientation, *geom.rgba, *geom.vertices)
        _check_far(f"body {body.name}", numbers)
    for camera in description.cameras:
        if camera.calibration is not None:
            _check_far(f"camera {camera.name}", _calibration_numbers(camera.calibration))
    for fence in description.geofences:
        _check_far(f"geofence {fence.name}", (number for corner in fence.polygon for number in corner))
    if (ring := description.ranges) is not None:
        numbers = [ring.angle_min, ring.angle_increment, ring.range_min, ring.range_max]
        _check_far(f"ranges {ring.name}", numbers)


def _check_far(where: str, numbers: Iterable[float]) -> None:
    for number in numbers:
        if not abs(number) <= FARTHEST:
            raise DescriptionError(f"{where}: every number must be finite and at most {FARTHEST:g}, not {number:g}")


def _check_texts(description: RobotDescription) -> None:
    """Check every text that is shown to people or names something."""
    texts = [description.name, description.label]
    for axis in description.axes:
        texts += [axis.name, axis.label, axis.unit]
    texts += [joint.name for joint in description.joints] + [body.name for body in description.bodies]
    labelled: list[Camera | Microphone | ControlLayer | PositionLimit | Geofence | Pose] = [
        *description.cameras,
        *description.microphones,
        *description.layers,
        *description.position_limits,
        *description.geofences,
        *description.poses,
    ]
    for each in labelled:
        texts += [each.name, each.label]
    texts += [each.calibration.distortion_model for each in description.cameras if each.calibration is not None]
    texts += action_texts(description.actions)
    for text in texts:
        if len(text) > MAX_NAME:
            raise DescriptionError(f"a name or label of {len(text)} characters, the bound is {MAX_NAME}")
        if any(unicodedata.category(each) in ("Cc", "Cs", "Zl", "Zp") or each in _CONTROL for each in text):
            raise DescriptionError(f"{text!r} has characters that cannot be printed")


def _check_camera(camera: Camera) -> None:
    if camera.width not in SIDES or camera.height not in SIDES:
        raise DescriptionError(f"camera {camera.name}: a picture of {camera.width}x{camera.height} is not possible")
    if not 0 < camera.frame_rate <= FRAME_RATES:
        raise DescriptionError(f"camera {camera.name}: frame_rate must be in (0, 240] Hz, not {camera.frame_rate}")
    scale = camera.metres_per_pixel
    if scale is not None and not (math.isfinite(scale) and scale > 0):
        raise DescriptionError(f"camera {camera.name}: metres_per_pixel must be positive, not {scale}")
    found = camera.calibration
    if found is not None and not (found.fx > 0 and found.fy > 0 and any(found.orientation)):
        raise DescriptionError(f"camera {camera.name}: its calibration needs focal lengths above 0 and an orientation")


def _calibration_numbers(found: CameraCalibration) -> list[float]:
    pinhole = [found.fx, found.fy, found.cx, found.cy]
    return [*pinhole, *found.distortion, *found.position, *found.orientation]


def _check_microphone(microphone: Microphone) -> None:
    if microphone.sample_rate not in SAMPLE_RATES or microphone.channels not in CHANNELS:
        raise DescriptionError(
            f"microphone {microphone.name}: {microphone.channels} channels of {microphone.sample_rate} Hz"
        )


def _check_ranges(ranges: RangeRing) -> None:
    if not 1 <= ranges.count <= MAX_RAYS:
        raise DescriptionError(f"ranges {ranges.name}: from 1 to {MAX_RAYS} rays, not {ranges.count}")


def _check_bodies(bodies: Sequence[Body]) -> None:
    parents = {body.name: body.parent for body in bodies}
    for body in bodies:
        where = f"body {body.name}"
        above, steps = body.parent, 0
        while above in parents:
            above, steps = parents[above], steps + 1
            if steps > len(bodies):
                raise DescriptionError(f"{where} is a part of itself")


def _check_feeling(feeling: ForceFeeling) -> None:
    if not 0 <= feeling.threshold_newtons < feeling.full_newtons < math.inf:
        raise DescriptionError("force_feeling needs 0 <= threshold_newtons < full_newtons, and both finite")
    if not 0.1 <= feeling.curve <= 10:
        raise DescriptionError(f"force_feeling: curve must be in [0.1, 10], not {feeling.curve}")


def _check_warning(description: RobotDescription, warning: StartWarning) -> None:
    if not 0 < warning.seconds <= 30:
        raise DescriptionError(f"start_warning: seconds must be in (0, 30], not {warning.seconds}")
    signal = next((axis for axis in description.axes if axis.name == warning.axis), None)
    if signal is None:
        raise DescriptionError(f"start_warning names the axis {warning.axis!r}, which is not described")
    if not signal.minimum <= warning.value <= signal.maximum or warning.value == signal.rest:
        raise DescriptionError(f"start_warning: the value must be one of axis {signal.name}, and not its rest value")
    moving = {gain.axis for limit in description.position_limits for gain in limit.axes}
    if description.planar_base is not None:
        base = description.planar_base
        moving |= {base.forward, base.left, base.turn}
    for twist in description.body_twists:
        moving |= {*twist.linear, *twist.angular}
    if signal.name in moving:
        raise DescriptionError(f"start_warning: axis {signal.name} moves the robot and cannot be its light or horn")
    if len(description.axes) == 1:
        raise DescriptionError("start_warning: a robot whose only axis is a light or horn has no motion to warn of")


def _check_references(description: RobotDescription) -> None:
    axes = {axis.name for axis in description.axes}
    joints = {joint.name for joint in description.joints}
    bodies = {""} | {body.name for body in description.bodies}
    for layer in description.layers:
        for binding in layer.bindings:
            _check_known("axis", binding.axis, axes, f"layer {layer.name}")
    for body in description.bodies:
        _check_known("body", body.parent, bodies, f"body {body.name}")
        for joint in body.joints:
            _check_known("joint", joint.joint, joints, f"body {body.name}")
    for twist in description.body_twists:
        where = f"the twist of {twist.body}"
        _check_known("body", twist.body, bodies - {""}, where)
        _check_known("body", twist.frame, bodies, where)
        for name in (*twist.linear, *twist.angular):
            _check_known("axis", name, axes | {""}, where)
        if not all(map(math.isfinite, twist.point)):
            raise DescriptionError(f"{where}: its point must be finite")
    for sensor in (description.wrench, description.ranges):
        if sensor is not None:
            _check_known("body", sensor.body, bodies, f"sensor {sensor.name}")
    for camera in description.cameras:
        if camera.calibration is not None:
            _check_known("body", camera.calibration.body, bodies, f"camera {camera.name}")


def _check_known(kind: str, name: str, known: set[str], where: str) -> None:
    if name not in known:
        raise DescriptionError(f"{where} names the {kind} {name!r}, which is not described")


def _check_unique(kind: str, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if not name or name in seen:
            raise DescriptionError(f"{kind} name {name!r} is empty or used twice")
        seen.add(name)
