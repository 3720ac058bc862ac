"""Builds the compiled model: the arm from its own files, on the table of scene.xml, with the parts that it lacks.

Additions to the arm: simple hulls for contacts, soft fingertips, the point that a tool's pose is about, a camera,
and a part of the servo's damping.
"""

import math
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.so101.simple_mesh import read_simple_mesh

__all__ = ["ARM", "GRIPPER", "JOINT_NAMES", "LINKS", "PREFIX", "TOOL", "TOOL_POINT", "build_model"]

PREFIX: Final = "arm."  # of every name of the arm's, as in "arm.shoulder_pan"
JOINT_NAMES: Final[tuple[str, ...]] = (
    "shoulder_pan",
    "shoulder_lift",
    "elbow_flex",
    "wrist_flex",
    "wrist_roll",
    "gripper",
)
LINKS: Final = ("base", "shoulder", "upper_arm", "lower_arm", "wrist", "gripper", "moving_jaw_so101_v1")
ARM: Final = slice(0, 5)  # of the joints
GRIPPER: Final = 5
TOOL: Final = "tool"  # site and body: x away from the gripper, z from the fixed jaw to the moving one
TOOL_POINT: Final = (0.008, -0.0002, -0.0945)  # m in the gripper's frame: the middle of a block between the fingertips

CELL: Final = 0.003  # m, of simplified meshes
VISUAL, HULL = 2, 3  # groups of the arm's geoms
DERIVATIVE: Final = 0.4  # N m s/rad, the derivative part of the servos' own controller
GRIPPER_TORQUE: Final = 1.0  # N m: 13 N between the fingertips; these servos have a torque limit too
RUBBER: Final = (1.3, 0.02, 0.0005)  # friction of the fingertips
PARALLEL: Final = 0.16  # rad, of the gripper's joint with a block of 28 mm: the fingertips are parallel then

Vector = tuple[float, float, float]

# The fingers are concave, so a hull that fits a whole mesh would fill the space between them: position, half extents.
HAND: Final[tuple[tuple[Vector, Vector], ...]] = (
    ((-0.003, 0.0, -0.0205), (0.032, 0.026, 0.0205)),
    ((-0.0225, 0.0, -0.066), (0.0085, 0.0085, 0.025)),
)
JAW: Final[tuple[tuple[Vector, Vector], ...]] = (((-0.0005, -0.042, 0.019), (0.0065, 0.027, 0.008)),)
FIXED_TIP: Final[tuple[Vector, Vector]] = ((-0.0105, -0.0002, -0.0955), (0.0045, 0.0065, 0.0090))
MOVING_TIP: Final[tuple[Vector, Vector]] = ((-0.0105, -0.0735, 0.0189), (0.0035, 0.0090, 0.0065))
BOWL_SIDES: Final = 12
BOWL_RADIUS, BOWL_HEIGHT, BOWL_LEAN = 0.054, 0.018, math.radians(28)  # m, m (half), of its wall


def build_model(arm_file: Path) -> Any:
    """Return the compiled MjModel. `arm_file`: the arm's MJCF file, its meshes in the folder that it names.

    Raises:
        ModelError: the files do not hold the arm that this scene was made for.
    """
    try:
        arm = mujoco.MjSpec.from_file(str(arm_file))
        scene = mujoco.MjSpec.from_string(files(__package__).joinpath("scene.xml").read_text())
        _simplify(arm, arm_file.parent / arm.meshdir)
        _prepare_links(arm)
        _prepare_servos(arm)
        _prepare_hand(arm)
        _add_bowl_walls(scene.body("bowl"))
        arm.compiler.fitaabb = True  # a hull is the box around its mesh
        scene.attach(arm, prefix=PREFIX, frame=scene.worldbody.add_frame())
        return scene.compile()
    except (ValueError, KeyError, AttributeError, OSError, mujoco.FatalError) as error:
        raise ModelError(f"{arm_file} is not the SO-101 that this robot needs: {error}") from error


def _simplify(arm: Any, folder: Path) -> None:
    for mesh in arm.meshes:
        simple = read_simple_mesh(folder / mesh.file, CELL)
        mesh.name = mesh.name or Path(mesh.file).stem
        mesh.file = ""
        mesh.uservert = simple.vertices.ravel()
        mesh.userface = simple.faces.ravel()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # never used: the links have inertias of their own


def _prepare_links(arm: Any) -> None:
    for name in LINKS:
        body = arm.body(name)
        hulls = [geom for geom in body.geoms if geom.group == HULL]
        if name == "base":
            hulls = [_copy_hull(body, geom) for geom in list(body.geoms) if geom.group == VISUAL]
        for geom in hulls:
            if name in ("gripper", LINKS[-1]):
                arm.delete(geom)
                continue
            geom.type = mujoco.mjtGeom.mjGEOM_BOX
            _touches(geom, foot=name == "base")
    # Boxes around neighbours overlap in any posture, as do those of two links with a short one between them.
    for first, second in (*zip(LINKS, LINKS[1:], strict=False), *zip(LINKS, LINKS[2:], strict=False)):
        arm.add_exclude(bodyname1=first, bodyname2=second)


def _copy_hull(body: Any, geom: Any) -> Any:
    return body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, meshname=geom.meshname, pos=geom.pos, quat=geom.quat, group=HULL
    )


def _touches(geom: Any, *, foot: bool = False) -> None:
    """Let a part of the arm touch things, the table, and the other parts; the foot stands on the table."""
    geom.contype, geom.conaffinity = (8, 5) if foot else (1, 15)
    geom.mass = 0.0


def _prepare_servos(arm: Any) -> None:
    for name in JOINT_NAMES:
        servo = arm.actuator(name)
        servo.biasprm[2] -= DERIVATIVE
    arm.actuator(JOINT_NAMES[GRIPPER]).forcerange = (-GRIPPER_TORQUE, GRIPPER_TORQUE)


def _prepare_hand(arm: Any) -> None:
    hand, jaw = arm.body("gripper"), arm.body(LINKS[-1])
    box = mujoco.mjtGeom.mjGEOM_BOX
    for body, parts in ((hand, HAND), (jaw, JAW)):
        for position, size in parts:
            _touches(body.add_geom(type=box, pos=position, size=size, group=HULL))
    half = -PARALLEL / 2
    for name, body, (position, size), turn in (
        ("fixed_tip", hand, FIXED_TIP, (1.0, 0.0, 0.0, 0.0)),
        ("moving_tip", jaw, MOVING_TIP, (math.cos(half), 0.0, 0.0, math.sin(half))),
    ):
        tip = body.add_geom(name=name, type=box, pos=position, size=size, quat=turn, group=4, rgba=(0.2, 0.2, 0.22, 1))
        _touches(tip)
        tip.friction, tip.condim, tip.priority = RUBBER, 4, 1
    hand.add_site(name=TOOL, pos=TOOL_POINT, quat=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0), group=5)
    # On a bracket at the right, so that both fingers are seen beside each other.
    hand.add_camera(name="gripper", pos=(0.01, -0.070, -0.012), quat=_looking((0.0, 0.62, -1.0)), fovy=66.0)


def _looking(direction: Vector) -> list[float]:
    """Return the orientation of a camera that looks in `direction` (in the hand's frame), the moving jaw up."""
    back = -np.array(direction) / np.linalg.norm(direction)
    right = np.cross((1.0, 0.0, 0.0), back)
    right /= np.linalg.norm(right)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.stack((right, np.cross(back, right), back), axis=1).ravel())
    return quaternion.tolist()


def _add_bowl_walls(bowl: Any) -> None:
    default = bowl.geoms[0].classname
    for place, turn, size in _bowl_walls():
        wall = bowl.add_geom(default, pos=place, quat=turn, size=size)
        wall.type = mujoco.mjtGeom.mjGEOM_BOX


def _bowl_walls() -> Iterator[tuple[Vector, list[float], Vector]]:
    width = BOWL_RADIUS * math.tan(math.pi / BOWL_SIDES) * 1.18
    for side in range(BOWL_SIDES):
        angle = 2 * math.pi * side / BOWL_SIDES
        around, outwards = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(around, np.array((0.0, 0.0, 1.0)), angle)
        mujoco.mju_axisAngle2Quat(outwards, np.array((0.0, 1.0, 0.0)), BOWL_LEAN)
        turn = np.zeros(4)
        mujoco.mju_mulQuat(turn, around, outwards)
        place = (BOWL_RADIUS * math.cos(angle), BOWL_RADIUS * math.sin(angle), BOWL_HEIGHT)
        yield place, turn.tolist(), (0.002, width, BOWL_HEIGHT)
