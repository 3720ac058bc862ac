"""Services, actions, grippers, map, status and calibration in a robot's file: what is asked, what stays off."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft import Draft, draft
from lockstep.robot_bridge.robots.ros2.discovery.graph import (
    ActionFields,
    ActionServer,
    Endpoint,
    Graph,
    Heard,
    ServiceServer,
    Topic,
)
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import (
    BATTERY,
    CAMERA_INFO,
    DESCRIPTION,
    DIAGNOSTICS,
    GRID,
    GRIPPER,
    IMAGE,
    NAVIGATE,
    PATH,
    POSE_COVARIANCE,
)
from lockstep.robot_bridge.robots.ros2.discovery.pose import Pose
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import TakeGuesses
from lockstep.robot_bridge.robots.ros2.pinhole import Pinhole
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings
from tests.robot_bridge.robots.ros2.discovery.graphs import Person, base_graph, published

URDF = (Path(__file__).parents[5] / "support" / "ros2" / "robot.urdf").read_text()
BEEP = ServiceServer("/tug/beep", "std_srvs/srv/Trigger", "/horn")
LIGHT = ServiceServer("/light", "std_srvs/srv/SetBool", "/lamps")
SPIN = ActionServer(
    "/spin",
    "nav2_msgs/action/Spin",
    "/behaviors",
    ActionFields({"target_yaw": "float", "quick": "boolean", "time": "builtin_interfaces/Duration"}, {}, {}),
)
GO = ActionServer("/navigate_to_pose", NAVIGATE, "/bt_navigator", ActionFields({}, {}, {}))
GRIP = ActionServer("/gripper_cmd", GRIPPER, "/gripper_controller", ActionFields({}, {}, {}))
MAP = Topic("/map", publishers=(Endpoint("/map_server", GRID, kept=True),))


def read(directory: Path, drafted: Draft) -> Ros2Settings:
    path = directory / "robot.yaml"
    path.write_text(drafted.text)
    return read_settings(path)[0]


def graph(*more: Topic, **changes: Any) -> Graph:
    found = base_graph(*more)
    return replace(found, heard={**found.heard, **changes.pop("heard", {})}, **changes)


def test_what_may_move_the_robot_is_written_as_a_comment_where_nobody_answers(tmp_path: Path) -> None:
    drafted = draft(graph(MAP, services=(BEEP, LIGHT), actions=(SPIN, GO, GRIP)), TakeGuesses(), None)
    settings = read(tmp_path, drafted)
    assert (settings.services, settings.actions, settings.grippers) == ((), (), ())
    assert settings.map is not None
    assert settings.map.goal is None
    for line in (
        "#   - {name: tug-beep, service: /tug/beep}",
        "#   - {name: light, service: /light, type: SetBool}",
        "#   - {name: spin, action: /spin, type: nav2_msgs/Spin",
        "#   - {name: gripper, action: /gripper_cmd",
        "#   goal: {action: /navigate_to_pose}",
    ):
        assert line in drafted.text
    assert any("switched off: light, tug-beep" in remark for remark in drafted.remarks)


def test_a_person_that_only_presses_enter_switches_nothing_on(tmp_path: Path) -> None:
    person = Person()
    settings = read(tmp_path, draft(graph(MAP, services=(BEEP,), actions=(SPIN, GO, GRIP)), person, None))
    assert (settings.services, settings.actions, settings.grippers) == ((), (), ())
    for start in ("May the page call /tug/beep", "Put /spin", "Put the gripper /gripper_cmd", "May a click on the map"):
        assert any(question.startswith(start) for question in person.asked), start


def test_what_a_person_agrees_to_is_on_and_each_number_of_a_goal_is_asked_for(tmp_path: Path) -> None:
    person = Person(May=True, Put=True, Least_target=-1.5, Greatest_target=1.5, Position_of=0.0)
    found = graph(MAP, services=(BEEP, LIGHT), actions=(SPIN, GO, GRIP))
    settings = read(tmp_path, draft(found, person, None))
    assert [(each.name, each.type) for each in settings.services] == [("light", "SetBool"), ("tug-beep", "Trigger")]
    (spin,) = settings.actions
    assert [(each.field, each.kind, each.minimum, each.maximum) for each in spin.parameters] == [
        ("quick", "switch", None, None),
        ("target_yaw", "number", -1.5, 1.5),
    ]
    assert [each.action for each in settings.grippers] == ["/gripper_cmd"]
    assert settings.map is not None
    assert settings.map.goal is not None


def test_an_action_that_is_not_installed_here_stays_off_and_is_not_asked_for(tmp_path: Path) -> None:
    person = Person(Put=True, May=True)
    found = graph(MAP, actions=(SPIN._replace(fields=None), GO._replace(fields=None)))
    drafted = draft(found, person, None)
    settings = read(tmp_path, drafted)
    assert settings.actions == ()
    assert settings.map is not None
    assert settings.map.goal is None
    assert drafted.text.count("nav2_msgs is not installed here") == 2


def test_an_action_whose_only_client_is_elsewhere_in_the_namespace_is_left_out(tmp_path: Path) -> None:
    found = replace(base_graph(namespace="/robot1"), services=(BEEP,), actions=(SPIN,))
    drafted = draft(found, TakeGuesses(), "/robot1")
    assert "spin" not in drafted.text
    assert "beep" not in drafted.text


@pytest.mark.parametrize(
    ("frames", "topics", "source", "sure"),
    [
        ({"odom": "map"}, (), "tf", True),
        ({"odom": "earth", "map": "earth"}, (), "tf", True),
        ({}, (published("/amcl_pose", POSE_COVARIANCE),), "topic", False),
        ({}, (), "tf", False),
    ],
)
def test_the_place_on_the_map_is_known_by_tf_or_by_a_topic(
    tmp_path: Path, frames: dict[str, str], topics: tuple[Topic, ...], source: str, sure: bool
) -> None:
    heard = {"/map": Heard(count=1, frame="map")}
    drafted = draft(graph(MAP, published("/plan", PATH), *topics, frames=frames, heard=heard), TakeGuesses(), None)
    settings = read(tmp_path, drafted)
    assert settings.map is not None
    assert (settings.map.place.source, settings.map.path) == (source, "/plan")
    in_map = drafted.text.partition("\nmap:")[2].partition("\n\n")[0]
    assert ("CHECK" in in_map) is not sure


def test_the_map_wins_over_the_costmap_and_one_that_is_not_kept_is_not_durable(tmp_path: Path) -> None:
    found = graph(published("/global_costmap/costmap", GRID), published("/map", GRID))
    settings = read(tmp_path, draft(found, TakeGuesses(), None))
    assert settings.map is not None
    assert (settings.map.topic, settings.map.durable, settings.map.path) == ("/map", False, "")


def test_the_status_has_every_battery_and_the_diagnostics(tmp_path: Path) -> None:
    found = graph(
        published("/front/battery", BATTERY),
        published("/rear/battery", BATTERY),
        published("/diagnostics", DIAGNOSTICS),
    )
    settings = read(tmp_path, draft(found, TakeGuesses(), None))
    assert [(each.name, each.topic) for each in settings.batteries] == [
        ("battery", "/front/battery"),
        ("rear-battery", "/rear/battery"),
    ]
    assert settings.diagnostics is not None
    assert settings.diagnostics.topic == "/diagnostics"


PINHOLE = Pinhole(640, 480, "eye", (500.0, 500.0, 320.0, 240.0), (480.0, 480.0, 310.0, 230.0), "plumb_bob", (0.1, 0.0))


def camera_graph(pinhole: Pinhole | None = PINHOLE, image: str = "/cam/image_raw", parent: str = "laser") -> Graph:
    heard = {
        image: Heard(count=9, rate=9.0, width=320, height=240, encoding="rgb8", stamped=True, frame="eye"),
        "/cam/camera_info": Heard(count=9, pinhole=pinhole),
    }
    return graph(
        published(image, IMAGE),
        published("/cam/camera_info", CAMERA_INFO),
        published("/robot_description", DESCRIPTION),
        heard=heard,
        descriptions={"/robot_description": URDF},
        mounts={"eye": (parent, Pose((0.0, 0.0, 0.1)))},
    )


def test_a_camera_has_the_pinhole_of_its_info_and_the_place_of_its_frame(tmp_path: Path) -> None:
    """Through a static frame of TF and a fixed joint of the URDF, to the first body that the file has."""
    drafted = draft(camera_graph(), TakeGuesses(), None)
    (camera,) = read(tmp_path, drafted).cameras
    found = camera.calibration
    assert found is not None
    assert (found.fx, found.cx, found.distortion_model, found.distortion) == (250.0, 160.0, "plumb_bob", (0.1, 0.0))
    assert (found.body, found.position) == ("base_link", (0.2, 0.0, 0.3))
    assert camera.info == "/cam/camera_info"
    assert "calibration" not in drafted.without_bodies, "the body that it names would not be there"


def test_rectified_pictures_have_the_pinhole_of_the_projection_without_distortion(tmp_path: Path) -> None:
    (camera,) = read(tmp_path, draft(camera_graph(image="/cam/image_rect"), TakeGuesses(), None)).cameras
    assert camera.calibration is not None
    assert (camera.calibration.fx, camera.calibration.cx, camera.calibration.distortion) == (240.0, 155.0, ())


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (camera_graph(parent="nowhere"), "where the frame 'eye' is fixed"),
        (camera_graph(parent="shoulder"), "where the frame 'eye' is fixed"),  # a joint that the description has not
        (camera_graph(pinhole=None), "says no calibration"),
        (camera_graph(pinhole=PINHOLE._replace(height=360)), "of another shape"),
    ],
)
def test_a_camera_whose_place_or_pinhole_is_not_known_has_no_calibration(
    tmp_path: Path, found: Graph, why: str
) -> None:
    drafted = draft(found, TakeGuesses(), None)
    (camera,) = read(tmp_path, drafted).cameras
    assert camera.calibration is None
    assert any(why in remark for remark in drafted.remarks)
