"""Bodies for the 3D scene from a URDF: simple shapes, boxes around meshes, joints that move them."""

from pathlib import Path

from lockstep.protocol.description import Body
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft_bodies import FindBox, draft_bodies
from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, render
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Box, parse_urdf

URDF = (Path(__file__).parents[5] / "support" / "ros2" / "robot.urdf").read_text()
BASE = "name: tug\nbase:\n  forward: {maximum: 0.5}\n"
ARM = "arm:\n  joints:\n    - {name: shoulder_pan_joint, maximum: 1}\n"


def no_box(_: str) -> None:
    return None


def bodies(directory: Path, text: str, head: str, find_box: FindBox) -> tuple[dict[str, Body], str]:
    """The bodies as the bridge describes them, and their YAML."""
    section = draft_bodies(parse_urdf(text), {"shoulder_pan_joint"} if ARM in head else set(), find_box, has_base=True)
    assert section is not None
    written = render(Section(values={"bodies": section}))
    path = directory / "robot.yaml"
    path.write_text(head + written)
    return {body.name: body for body in read_settings(path)[1].bodies}, written


def test_joints_that_are_driven_move_their_bodies_and_the_others_do_not(tmp_path: Path) -> None:
    found, _ = bodies(tmp_path, URDF, BASE + ARM, no_box)
    assert found["base_link"].parent == "base"
    assert found["shoulder"].joints[0].joint == "shoulder_pan_joint"
    assert list(found["shoulder"].joints[0].axis) == [0, 0, 1]
    assert not found["upper_arm"].joints
    assert list(found["upper_arm"].position) == [0, 0, 0.3]
    assert "laser" not in found, "a link that nobody sees needs no body"


def test_a_mesh_is_drawn_as_its_box_where_its_file_can_be_read(tmp_path: Path) -> None:
    found, written = bodies(tmp_path, URDF, BASE, no_box)
    assert "wrist_3" not in found
    assert "could not be read, which are not drawn: wrist_3" in written
    text = URDF.replace('wrist_3.stl"', 'wrist_3.stl" scale="0.001 0.001 -0.001"')
    found, written = bodies(tmp_path, text, BASE, lambda uri: Box((10.0, 0.0, 20.0), (50.0, 40.0, 0.0)))
    (geom,) = found["wrist_3"].geoms
    assert (geom.shape, list(geom.size)) == ("box", [0.05, 0.04, 0.001])
    assert list(geom.position) == [0.01, 0, 0.13], "the mesh is mirrored, and stands 0.15 m above its link"
    assert "boxes around their meshes: wrist_3" in written


def test_a_link_with_the_name_of_the_base_gets_another(tmp_path: Path) -> None:
    found, _ = bodies(tmp_path, URDF.replace("base_link", "base"), BASE, no_box)
    assert found["link.base"].parent == "base"
    assert found["link.shoulder"].parent == "link.base"


def test_a_robot_without_shapes_has_no_bodies() -> None:
    assert draft_bodies(parse_urdf('<robot name="x"><link name="a"/></robot>'), set(), no_box, has_base=True) is None
