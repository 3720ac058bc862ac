"""Bodies for the 3D scene from a URDF: simple shapes, meshes, joints that move them."""

from pathlib import Path

import msgspec

from lockstep.protocol.description import Body
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_bodies import MOST_FRAMES, FindMesh, draft_bodies
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, render
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Mesh, parse_urdf

URDF = (Path(__file__).parents[5] / "support" / "ros2" / "robot.urdf").read_text()
BASE = "name: tug\nbase:\n  forward: {maximum: 0.5}\n"
ARM = "arm:\n  joints:\n    - {name: shoulder_pan_joint, maximum: 1}\n"


def no_mesh(name: str, most: int) -> None:
    return None


def bodies(directory: Path, text: str, head: str, find_mesh: FindMesh) -> tuple[dict[str, Body], str]:
    """The bodies as the bridge describes them, and their YAML."""
    section = draft_bodies(parse_urdf(text), {"shoulder_pan_joint"} if ARM in head else set(), find_mesh, has_base=True)
    assert section is not None
    written = render(Section(values={"bodies": section}))
    path = directory / "robot.yaml"
    path.write_text(head + written)
    return {body.name: body for body in read_settings(path)[1].bodies}, written


def test_joints_that_are_driven_move_their_bodies_and_the_others_do_not(tmp_path: Path) -> None:
    found, _ = bodies(tmp_path, URDF, BASE + ARM, no_mesh)
    assert found["base_link"].parent == "base"
    assert found["shoulder"].joints[0].joint == "shoulder_pan_joint"
    assert list(found["shoulder"].joints[0].axis) == [0, 0, 1]
    assert not found["upper_arm"].joints
    assert list(found["upper_arm"].position) == [0, 0, 0.3]
    assert "laser" not in found, "a link that nobody sees needs no body"


def test_a_frame_without_a_shape_is_a_body_where_a_joint_that_is_driven_moves_it(tmp_path: Path) -> None:
    tool = (
        '<link name="tool0"/><joint name="mount" type="fixed"><parent link="wrist_2"/><child link="tool0"/>'
        '<origin xyz="0 0 0.1"/></joint></robot>'
    )
    found, _ = bodies(tmp_path, URDF.replace("</robot>", tool), BASE + ARM, no_mesh)
    assert (found["tool0"].parent, list(found["tool0"].position)) == ("wrist_2", [0, 0, 0.1])
    assert not found["tool0"].geoms
    found, _ = bodies(tmp_path, URDF.replace("</robot>", tool), BASE, no_mesh)
    assert "tool0" not in found


def test_the_frames_between_the_root_and_an_arm_that_is_not_drawn_are_bodies_too(tmp_path: Path) -> None:
    text = URDF.replace(
        "</robot>",
        '<link name="world"/><joint name="stand" type="fixed"><parent link="world"/>'
        '<child link="base_link"/></joint><link name="table"><visual><geometry><box size="1 1 1"/></geometry></visual>'
        '</link><joint name="floor" type="fixed"><parent link="world"/><child link="table"/></joint></robot>',
    )
    for drawn in ('<box size="0.5 0.4 0.2"/>', '<cylinder radius="0.05" length="0.3"/>'):
        text = text.replace(drawn, '<mesh filename="package://x/y.dae"/>')
    found, _ = bodies(tmp_path, text, BASE + ARM, no_mesh)
    assert (found["shoulder"].parent, found["base_link"].parent) == ("base_link", "world")


def test_many_frames_are_left_out(tmp_path: Path) -> None:
    frames = "".join(
        f'<link name="f{number}"/><joint name="to_f{number}" type="fixed"><parent link="shoulder"/>'
        f'<child link="f{number}"/></joint>'
        for number in range(MOST_FRAMES + 1)
    )
    found, _ = bodies(tmp_path, URDF.replace("</robot>", frames + "</robot>"), BASE + ARM, no_mesh)
    assert "shoulder" in found
    assert "f0" not in found


def test_a_mesh_is_drawn_where_its_file_can_be_read(tmp_path: Path) -> None:
    found, written = bodies(tmp_path, URDF, BASE, no_mesh)
    assert "wrist_3" not in found
    assert "could not be read, which are not drawn: wrist_3" in written
    text = URDF.replace('wrist_3.stl"', 'wrist_3.stl" scale="0.001 0.001 -0.001"')
    mesh = Mesh([(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 40.0, 10.0)], [(0, 1, 2)])
    asked: list[int] = []

    def find(name: str, most: int) -> Mesh:
        asked.append(most)
        return mesh

    found, written = bodies(tmp_path, text, BASE, find)
    (geom,) = found["wrist_3"].geoms
    assert (geom.shape, list(geom.vertices)) == ("mesh", [0, 0, 0, 0.05, 0, 0, 0, 0.04, -0.01])
    assert list(geom.triangles) == [2, 1, 0], "it is mirrored, and would be seen from inside"
    assert list(geom.position) == [0, 0, 0.15], "as the URDF places it"
    assert asked == [150]
    assert "Drawn by their meshes, with at most 150 corners: wrist_3" in written


def test_many_meshes_share_the_room_of_a_description(tmp_path: Path) -> None:
    links = "".join(
        f'<link name="l{number}"><visual><geometry><mesh filename="file:///l.stl"/></geometry></visual></link>'
        f'<joint name="j{number}" type="fixed"><parent link="{f"l{number - 1}" if number else "root"}"/>'
        f'<child link="l{number}"/></joint>'
        for number in range(30)
    )
    asked = set[int]()

    def find(name: str, most: int) -> Mesh:
        asked.add(most)
        vertices = [(0.1234 * at, -0.4321, 0.2345) for at in range(most)]
        return Mesh(vertices, [(at, at + 1, at + 2) for at in range(most - 2) for _ in range(2)])

    found, _ = bodies(tmp_path, f'<robot name="r"><link name="root"/>{links}</robot>', BASE, find)
    assert asked == {25}
    assert len(msgspec.json.encode(list(found.values()))) < 45_000


def test_a_link_with_the_name_of_the_base_gets_another(tmp_path: Path) -> None:
    found, _ = bodies(tmp_path, URDF.replace("base_link", "base"), BASE, no_mesh)
    assert found["link.base"].parent == "base"
    assert found["link.shoulder"].parent == "link.base"


def test_a_robot_without_shapes_has_no_bodies() -> None:
    assert draft_bodies(parse_urdf('<robot name="x"><link name="a"/></robot>'), set(), no_mesh, has_base=True) is None
