"""The planar robot's description for a console."""

import math

from lockstep.protocol.description import (
    Action,
    ActionParameter,
    Axis,
    Binding,
    Body,
    BodyJoint,
    Camera,
    CameraCalibration,
    ControlLayer,
    ForceFeeling,
    Geofence,
    Geom,
    Joint,
    MapView,
    Microphone,
    PlanarBase,
    RangeRing,
    RobotDescription,
    WrenchSensor,
)
from lockstep.robot_bridge.robots.planar.room import CHARGER, HALF_LENGTH, HALF_WIDTH, PILLARS

__all__ = ["DESCRIPTION", "FIELD_OF_VIEW", "FRONT", "MICROPHONE", "OVERVIEW", "RADIUS", "RANGES", "WALL_HEIGHT"]

RADIUS = 0.3  # m

OVERVIEW = Camera(name="overview", label="Overview", width=640, height=480, frame_rate=30.0)
FIELD_OF_VIEW = math.radians(75)
WALL_HEIGHT = 0.9  # m; the camera is at half of it
FRONT = Camera(
    name="front",
    label="Front",
    width=320,
    height=240,
    frame_rate=15.0,
    calibration=CameraCalibration(
        fx=160 / math.tan(FIELD_OF_VIEW / 2),
        fy=160 / math.tan(FIELD_OF_VIEW / 2),
        cx=160.0,
        cy=120.0,
        body="base",
        position=(0.0, 0.0, WALL_HEIGHT / 2),
        orientation=(0.5, -0.5, 0.5, -0.5),  # looks along x of the base
    ),
)
MICROPHONE = Microphone(name="microphone", label="Microphone", sample_rate=48_000)

RANGES = RangeRing(
    name="ranges",
    body="base",
    count=24,
    angle_min=-math.pi,
    angle_increment=2 * math.pi / 24,
    range_min=0.02,
    range_max=5.0,
)

BEHIND_WALLS = 0.05  # m: a wall may be touched, not passed
_LENGTH, _WIDTH = HALF_LENGTH + BEHIND_WALLS, HALF_WIDTH + BEHIND_WALLS
_LEFT, _LOW, _RIGHT, _HIGH = CHARGER

_WALL = (0.45, 0.5, 0.55, 1.0)
_FORBIDDEN = (0.75, 0.25, 0.25, 1.0)

DESCRIPTION = RobotDescription(
    name="planar",
    label="Planar robot (simulated without physics engine)",
    max_event_rate=60.0,
    axes=(
        Axis(name="base.vx", label="Forward", unit="m/s", minimum=-0.8, maximum=0.8, slew=4.0, brake=8.0),
        Axis(name="base.vy", label="Left", unit="m/s", minimum=-0.8, maximum=0.8, slew=4.0, brake=8.0),
        Axis(name="base.wz", label="Turn left", unit="rad/s", minimum=-1.5, maximum=1.5, slew=8.0, brake=15.0),
    ),
    joints=(
        Joint(name="base.x", unit="m", minimum=-HALF_LENGTH, maximum=HALF_LENGTH),
        Joint(name="base.y", unit="m", minimum=-HALF_WIDTH, maximum=HALF_WIDTH),
        Joint(name="base.yaw", unit="rad"),
    ),
    layers=(
        ControlLayer(
            name="drive",
            label="Drive",
            bindings=(
                Binding(
                    axis="base.vx",
                    pad="left_y",
                    invert_pad=True,
                    touch="left_y",
                    key_positive="KeyW",
                    key_negative="KeyS",
                ),
                Binding(
                    axis="base.vy",
                    pad="left_x",
                    invert_pad=True,
                    touch="left_x",
                    invert_touch=True,
                    key_positive="KeyA",
                    key_negative="KeyD",
                ),
                Binding(
                    axis="base.wz",
                    pad="right_x",
                    invert_pad=True,
                    touch="right_x",
                    invert_touch=True,
                    key_positive="KeyQ",
                    key_negative="KeyE",
                ),
            ),
        ),
    ),
    actions=(
        Action(name="home", label="Home"),
        Action(name="dock", label="Dock"),
        Action(
            name="light",
            label="Light",
            moves=False,
            parameters=(ActionParameter(name="on", label="On", kind="switch", default=True),),
        ),
        Action(
            name="go_to",
            label="Go to",
            parameters=(
                ActionParameter(
                    name="x", label="x", kind="number", unit="m", minimum=-HALF_LENGTH, maximum=HALF_LENGTH
                ),
                ActionParameter(name="y", label="y", kind="number", unit="m", minimum=-HALF_WIDTH, maximum=HALF_WIDTH),
                ActionParameter(
                    name="yaw", label="Heading", kind="number", unit="rad", minimum=-4, maximum=4, default=0.0
                ),
            ),
        ),
    ),
    map=MapView(x="base.x", y="base.y", yaw="base.yaw", radius=RADIUS, goal="go_to"),
    cameras=(OVERVIEW, FRONT),
    microphones=(MICROPHONE,),
    wrench=WrenchSensor(name="bumper", body="base", threshold_force=2.0, full_scale_force=80.0, full_scale_torque=20.0),
    force_feeling=ForceFeeling(threshold_newtons=2.0, full_newtons=60.0, curve=0.6),
    ranges=RANGES,
    bodies=(
        Body(
            name="room",
            parent="",
            geoms=(
                Geom(
                    shape="box", size=(HALF_LENGTH, HALF_WIDTH, 0.01), position=(0, 0, -0.01), rgba=(0.2, 0.22, 0.25, 1)
                ),
                Geom(shape="box", size=(0.05, HALF_WIDTH, 0.25), position=(HALF_LENGTH + 0.05, 0, 0.25), rgba=_WALL),
                Geom(shape="box", size=(0.05, HALF_WIDTH, 0.25), position=(-HALF_LENGTH - 0.05, 0, 0.25), rgba=_WALL),
                Geom(shape="box", size=(HALF_LENGTH, 0.05, 0.25), position=(0, HALF_WIDTH + 0.05, 0.25), rgba=_WALL),
                Geom(shape="box", size=(HALF_LENGTH, 0.05, 0.25), position=(0, -HALF_WIDTH - 0.05, 0.25), rgba=_WALL),
                Geom(
                    shape="box",
                    size=((_RIGHT - _LEFT) / 2, (_HIGH - _LOW) / 2, 0.002),
                    position=((_RIGHT + _LEFT) / 2, (_HIGH + _LOW) / 2, 0.002),
                    rgba=_FORBIDDEN,
                ),
                *(
                    Geom(shape="cylinder", size=(radius, 0.4, 0), position=(x, y, 0.4), rgba=(0.75, 0.5, 0.3, 1))
                    for x, y, radius in PILLARS.tolist()
                ),
            ),
        ),
        Body(
            name="base",
            parent="",
            joints=(
                BodyJoint(joint="base.x", kind="prismatic", axis=(1, 0, 0)),
                BodyJoint(joint="base.y", kind="prismatic", axis=(0, 1, 0)),
                BodyJoint(joint="base.yaw", kind="revolute", axis=(0, 0, 1)),
            ),
            geoms=(
                Geom(shape="cylinder", size=(RADIUS, 0.2, 0), position=(0, 0, 0.2), rgba=(0.25, 0.55, 0.85, 1)),
                Geom(shape="box", size=(0.12, 0.03, 0.02), position=(0.15, 0, 0.42), rgba=(0.95, 0.95, 0.95, 1)),
            ),
        ),
    ),
    planar_base=PlanarBase(
        x="base.x",
        y="base.y",
        yaw="base.yaw",
        forward="base.vx",
        left="base.vy",
        turn="base.wz",
        radius=RADIUS,
    ),
    geofences=(
        Geofence(
            name="room",
            label="Room",
            kind="keep_in",
            polygon=((-_LENGTH, -_WIDTH), (_LENGTH, -_WIDTH), (_LENGTH, _WIDTH), (-_LENGTH, _WIDTH)),
        ),
        Geofence(
            name="charger",
            label="Charging corner",
            kind="keep_out",
            polygon=((_LEFT, _LOW), (_RIGHT, _LOW), (_RIGHT, _HIGH), (_LEFT, _HIGH)),
        ),
    ),
    watchdog=0.25,  # a simulation hurts no person, and busy machines hold it up
)
