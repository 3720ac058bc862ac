"""A URDF from a topic: joints, limits, frames; what is none is refused by name."""

import math
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.robots.ros2.discovery.urdf import BadUrdf, parse_urdf

URDF = (Path(__file__).parents[4] / "support" / "ros2" / "robot.urdf").read_text()
LINKS = '<link name="a"/><link name="b"/>'


def test_joints_limits_and_shapes_are_read() -> None:
    urdf = parse_urdf(URDF)
    assert (urdf.name, urdf.root, len(urdf.joints)) == ("six-joint-tug", "base_link", 7)
    pan, wrist = urdf.joints["shoulder_pan_joint"], urdf.joints["wrist_3_joint"]
    assert (pan.kind, pan.lower, pan.upper, pan.velocity, pan.axis) == ("revolute", -3.0, 3.0, 2.0, (0, 0, 1))
    assert (wrist.kind, wrist.lower, wrist.velocity) == ("continuous", None, 2.0)
    assert urdf.links["base_link"].visual[0].size == (0.25, 0.2, 0.1)
    assert urdf.links["wrist_3"].visual[0].shape == "mesh"


def test_a_frame_has_a_pose_unless_a_joint_moves_it() -> None:
    urdf = parse_urdf(URDF)
    pose = urdf.pose("laser")
    assert pose is not None
    assert pose.position == pytest.approx((0.2, 0.0, 0.2))
    assert pose.yaw == pytest.approx(1.5708)
    assert urdf.pose("shoulder") is None
    assert urdf.pose("nowhere") is None


def test_poses_follow_one_another() -> None:
    urdf = parse_urdf(
        f'<robot name="x">{LINKS}<link name="c"/>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/>'
        '<origin xyz="1 0 0" rpy="0 0 1.570796"/></joint>'
        '<joint name="k" type="fixed"><parent link="b"/><child link="c"/>'
        '<origin xyz="1 0 0" rpy="3.141593 0 0"/></joint>'
        "</robot>"
    )
    pose = urdf.pose("c")
    assert pose is not None
    assert pose.position == pytest.approx((1.0, 1.0, 0.0), abs=1e-5)
    assert pose.yaw == pytest.approx(math.pi / 2, abs=1e-5)
    assert pose.upright == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "is not XML"),
        ("<robot>", "is not XML"),
        ("<model/>", "no element <robot>"),
        ("<robot/>", "has no link"),
        ('<!DOCTYPE robot [<!ENTITY a "b">]><robot><link name="&a;"/></robot>', "document type"),
        (f"<robot>{LINKS}</robot>", "no tree"),
        ('<robot><link name=""/></robot>', "without a usable name"),
        (
            '<robot><link name="a"><visual><geometry><box size="1 2"/></geometry></visual></link></robot>',
            "three numbers",
        ),
        ('<robot><link name="a"><visual><geometry><box size="1 2 nan"/></geometry></visual></link></robot>', "beyond"),
        ('<robot><link name="a"><visual><geometry><sphere/></geometry></visual></link></robot>', "not a number"),
        (
            f'<robot>{LINKS}<link name="c"/>'
            '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
            '<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>',
            "circle",
        ),
        (
            f'<robot>{LINKS}<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
            '<axis xyz="0 0 0"/></joint></robot>',
            "no direction",
        ),
        ("x" * (5 << 20), "longer than"),
    ],
)
def test_what_is_no_robot_is_refused_by_name(text: str, complaint: str) -> None:
    with pytest.raises(BadUrdf, match=complaint):
        parse_urdf(text)


@given(st.data())
def test_only_a_named_refusal_comes_out_of_a_text_that_was_damaged(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(URDF)))
    end = data.draw(st.integers(start, min(len(URDF), start + 200)))
    middle = data.draw(st.text(max_size=20) | st.sampled_from(['"', "<link name='laser'/>", "1e999", "&lt;", "-1"]))
    with suppress(BadUrdf):
        urdf = parse_urdf(URDF[:start] + middle + URDF[end:])
        for link in urdf.links:
            urdf.pose(link)
