"""The micromanipulator's description for a console."""

import math
from typing import Final

from lockstep.protocol.description import (
    Action,
    ActionParameter,
    Axis,
    AxisGain,
    Binding,
    Body,
    BodyJoint,
    Camera,
    ControlLayer,
    ForceFeeling,
    Geom,
    Joint,
    Microphone,
    PositionLimit,
    RobotDescription,
    WrenchSensor,
)
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES
from lockstep.robot_bridge.robots.stick_bindings import leftwards, upwards

__all__ = [
    "DESCRIPTION",
    "HEADING",
    "MICROPHONE",
    "MICROSCOPE",
    "SIDE",
    "SLOPE",
    "START",
    "TAPER",
    "WINDOWS",
]

# A sensor 6.4 mm wide behind a lens of 20x sees 320 µm; 640 columns make that half a micrometre each.
MICROSCOPE: Final = Camera(
    name="microscope",
    label="Microscope 20×",
    width=640,
    height=480,
    frame_rate=30.0,
    metres_per_pixel=0.5 * MICRO,
    click="centre",
)
SIDE: Final = Camera(
    name="side", label="Section at the tip", width=320, height=240, frame_rate=15.0, metres_per_pixel=0.5 * MICRO
)
MICROPHONE: Final = Microphone(name="microphone", label="Microphone", sample_rate=48_000)

START: Final = (-8 * MICRO, 0.0, 45 * MICRO)  # the tip
HEADING: Final = math.radians(205.0)  # of the shaft from the tip to the holder, seen from above
SLOPE: Final = math.tan(math.radians(20.0))  # rise of the shaft
TAPER: Final = 0.09  # half width gained per length
WINDOWS: Final = {  # ranges of the joints, m
    "probe.x": (-90 * MICRO, 110 * MICRO),
    "probe.y": (-145 * MICRO, 145 * MICRO),
    "probe.z": (-16 * MICRO, 90 * MICRO),
    "focus.z": (-30 * MICRO, 80 * MICRO),
    "view.x": (-60 * MICRO, 60 * MICRO),  # of the middle of the microscope's picture: all of the slide can be seen
    "view.y": (-80 * MICRO, 80 * MICRO),
}
SLEW_TIME: Final = 0.1  # s from rest to full speed
BRAKE_TIME: Final = 0.04  # s from full speed to rest
FINE: Final = 0.1  # of full speed, in the fine layer


def _axis(name: str, label: str, fastest: float, unit: str = "m/s") -> Axis:
    return Axis(
        name=name,
        label=label,
        unit=unit,
        minimum=-fastest,
        maximum=fastest,
        slew=fastest / SLEW_TIME,
        brake=fastest / BRAKE_TIME,
    )


def _probe(scale: float) -> tuple[Binding, ...]:
    return (
        upwards("probe.vx", "left_y", "left_y", ("KeyW", "KeyS"), scale=scale),
        leftwards("probe.vy", "left_x", "left_x", ("KeyA", "KeyD"), scale=scale),
        upwards("probe.vz", "right_y", "right_y", ("KeyR", "KeyF"), scale=scale),
        upwards("focus.vz", "dpad_y", None, ("ArrowUp", "ArrowDown")),
    )


LAYERS: Final = (
    ControlLayer(name="coarse", label="Coarse", bindings=_probe(1.0)),
    ControlLayer(name="fine", label="Fine", bindings=_probe(FINE)),
    ControlLayer(
        name="microscope",
        label="Microscope",
        bindings=(
            upwards("focus.vz", "left_y", "left_y", ("KeyW", "KeyS")),
            Binding(axis="light.rate", pad="left_x", touch="left_x", key_positive="KeyD", key_negative="KeyA"),
            upwards("probe.vz", "right_y", None, ("KeyR", "KeyF"), scale=FINE),
            upwards("view.vx", "dpad_y", "right_y", ("ArrowUp", "ArrowDown")),
            leftwards("view.vy", "dpad_x", "right_x", ("ArrowLeft", "ArrowRight")),
        ),
    ),
)

SENSOR_BODY: Final = "holder"


def _limit(joint: str, axis: str, label: str) -> PositionLimit:
    low, high = WINDOWS[joint]
    return PositionLimit(
        name=f"{joint}.range", label=label, joint=joint, minimum=low, maximum=high, axes=(AxisGain(axis=axis),)
    )


def _needle() -> tuple[Geom, ...]:
    """Return the shaft as capsules that get thicker away from the tip, and a block that holds it."""
    cos, sin = math.cos(HEADING), math.sin(HEADING)
    pitch = math.atan(SLOPE)
    # Turns a capsule's z onto the shaft: about y by the rest to the horizontal, then about z to the heading.
    half_tilt, half_turn = (math.pi / 2 - pitch) / 2, HEADING / 2
    orientation = (
        math.cos(half_turn) * math.cos(half_tilt),
        -math.sin(half_turn) * math.sin(half_tilt),
        math.cos(half_turn) * math.sin(half_tilt),
        math.sin(half_turn) * math.cos(half_tilt),
    )
    geoms = []
    for start, end in ((3, 25), (25, 60), (60, 110), (110, 170)):
        along, half = (start + end) / 2 * MICRO, (end - start) / 2 * MICRO
        geoms.append(
            Geom(
                shape="capsule",
                size=(3 * MICRO + TAPER * along, half, 0.0),
                position=(cos * along, sin * along, SLOPE * along + 3 * MICRO),
                orientation=orientation,
                rgba=(0.75, 0.78, 0.82, 1.0),
            )
        )
    along = 195 * MICRO
    geoms.append(
        Geom(
            shape="box",
            size=(26 * MICRO, 26 * MICRO, 26 * MICRO),
            position=(cos * along, sin * along, SLOPE * along),
            orientation=(math.cos(half_turn), 0.0, 0.0, math.sin(half_turn)),
            rgba=(0.20, 0.24, 0.30, 1.0),
        )
    )
    return tuple(geoms)


def _slide() -> tuple[Geom, ...]:
    """Return the glass, and each drop as rounds that get narrower with height."""
    glass = Geom(
        shape="box",
        size=(135 * MICRO, 170 * MICRO, 4 * MICRO),
        position=(0.0, 0.0, -4 * MICRO),
        rgba=(0.28, 0.36, 0.44, 1.0),
    )
    drops = []
    for sample in SAMPLES:
        rounds = 5
        for number in range(rounds):
            middle = (number + 0.5) / rounds
            drops.append(
                Geom(
                    shape="cylinder",
                    size=(sample.radius * math.sqrt(1.0 - middle), sample.height / rounds / 2, 0.0),
                    position=(sample.x, sample.y, sample.height * middle),
                    rgba=(*sample.rgb, 1.0),
                )
            )
    return (glass, *drops)


DESCRIPTION: Final = RobotDescription(
    name="micromanipulator",
    label="Micromanipulator (simulated)",
    max_event_rate=60.0,
    watchdog=0.25,  # a simulation hurts no person, and busy machines hold it up
    axes=(
        _axis("probe.vx", "Forward", 60 * MICRO),
        _axis("probe.vy", "Left", 60 * MICRO),
        _axis("probe.vz", "Up", 30 * MICRO),
        _axis("focus.vz", "Focus up", 40 * MICRO),
        _axis("view.vx", "View forward", 60 * MICRO),
        _axis("view.vy", "View left", 60 * MICRO),
        _axis("light.rate", "Brighter", 50.0, "%/s"),
    ),
    joints=tuple(Joint(name=name, unit="m", minimum=low, maximum=high) for name, (low, high) in WINDOWS.items()),
    layers=LAYERS,
    actions=(
        Action(name="autofocus", label="Autofocus"),
        Action(name="snapshot", label="Snapshot", moves=False),
        Action(
            name="centre",
            label="Centre the picture there",
            parameters=(
                ActionParameter(name="x", label="From the left", kind="number", minimum=0, maximum=1),
                ActionParameter(name="y", label="From the top", kind="number", minimum=0, maximum=1),
                ActionParameter(name="event", label="Event of the picture", kind="number", minimum=1),
            ),
        ),
        Action(name="tip_to_middle", label="Tip to the middle"),
    ),
    cameras=(MICROSCOPE, SIDE),
    microphones=(MICROPHONE,),
    wrench=WrenchSensor(
        name="probe", body=SENSOR_BODY, threshold_force=1e-6, full_scale_force=400e-6, full_scale_torque=1e-7
    ),
    force_feeling=ForceFeeling(threshold_newtons=1e-6, full_newtons=300e-6, curve=0.6),
    bodies=(
        Body(name="slide", parent="", geoms=_slide()),
        Body(
            name=SENSOR_BODY,
            parent="",
            joints=(
                BodyJoint(joint="probe.x", kind="prismatic", axis=(1, 0, 0)),
                BodyJoint(joint="probe.y", kind="prismatic", axis=(0, 1, 0)),
                BodyJoint(joint="probe.z", kind="prismatic", axis=(0, 0, 1)),
            ),
            geoms=_needle(),
        ),
        Body(
            name="focal plane",
            parent="",
            joints=(
                BodyJoint(joint="view.x", kind="prismatic", axis=(1, 0, 0)),
                BodyJoint(joint="view.y", kind="prismatic", axis=(0, 1, 0)),
                BodyJoint(joint="focus.z", kind="prismatic", axis=(0, 0, 1)),
            ),
            geoms=(Geom(shape="box", size=(120 * MICRO, 160 * MICRO, 0.2 * MICRO), rgba=(0.3, 0.8, 1.0, 0.10)),),
        ),
    ),
    position_limits=(
        _limit("probe.x", "probe.vx", "Forward"),
        _limit("probe.y", "probe.vy", "Sideways"),
        _limit("probe.z", "probe.vz", "Height"),
        _limit("focus.z", "focus.vz", "Focus"),
        _limit("view.x", "view.vx", "View forward"),
        _limit("view.y", "view.vy", "View sideways"),
    ),
)
