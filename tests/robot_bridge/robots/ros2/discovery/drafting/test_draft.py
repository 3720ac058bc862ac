"""A robot's file from a graph: what is seen, what is asked, what is guessed and marked."""

from dataclasses import replace
from pathlib import Path

import pytest

from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.discovery.drafting.choice import SeveralRobots, robots
from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft import NothingToDrive, draft
from lockstep.robot_bridge.robots.ros2.discovery.graph import Graph, Heard, ParameterValue, Topic
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import (
    COMPRESSED,
    FLOATS,
    IMAGE,
    INT8,
    JOINT_STATE,
    ODOMETRY,
    SCAN,
    TRAJECTORY,
    TWIST,
    TWIST_STAMPED,
    WRENCH,
)
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import TakeGuesses
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings
from tests.robot_bridge.robots.ros2.discovery.graphs import Person, base_graph, published, taken, topics

URDF = (Path(__file__).parents[5] / "support" / "ros2" / "robot.urdf").read_text()


def read(directory: Path, text: str) -> Ros2Settings:
    path = directory / "robot.yaml"
    path.write_text(text)
    return read_settings(path)[0]


def arm_graph(topic: str, kind: str, **parameters: str | list[str]) -> Graph:
    return Graph(
        topics(taken(topic, kind, "/controller"), published("/joint_states", JOINT_STATE)),
        {"/joint_states": Heard(count=9, rate=50.0, joints=("elbow", "left_wheel_joint", "wrist"))},
        {"/controller": parameters},
    )


def test_a_base_is_guessed_with_care_and_every_guess_is_marked(tmp_path: Path) -> None:
    drafted = draft(base_graph(), TakeGuesses(), None)
    settings = read(tmp_path, drafted.text)
    assert settings.base is not None
    assert (settings.base.forward.maximum, settings.base.turn and settings.base.turn.maximum) == (0.2, 0.5)
    assert settings.base.left is None
    assert settings.base.command.frame == "base_footprint"
    assert drafted.guesses == drafted.text.count("# CHECK:") == 4
    assert "20 Hz" in drafted.text


def test_a_person_is_asked_for_limits_and_timing_and_the_answers_are_no_guesses(tmp_path: Path) -> None:
    person = Person(Fastest_forward=0.8, Fastest_turning=1.5, Can_the_base=True, Radius=0.2, A_command=0.4)
    drafted = draft(base_graph(), person, None)
    settings = read(tmp_path, drafted.text)
    assert settings.base is not None
    assert (settings.base.forward.maximum, settings.base.radius, settings.hold) == (0.8, 0.2, 0.4)
    assert settings.base.left is not None
    assert "as you said" in drafted.text
    assert drafted.guesses == 1, "the timeout of the base's own controller is left to check"


def test_a_plain_twist_is_written_as_the_subscriber_takes_it(tmp_path: Path) -> None:
    settings = read(tmp_path, draft(base_graph(kind=TWIST), TakeGuesses(), None).text)
    assert settings.base is not None
    assert settings.base.command.message == "Twist"


def test_what_the_controller_says_of_itself_is_used(tmp_path: Path) -> None:
    parameters: dict[str, ParameterValue] = {
        "linear.x.max_velocity": 0.1,
        "cmd_vel_timeout": 0.25,
        "base_frame_id": "chassis",
    }
    drafted = draft(replace(base_graph(), parameters={"/driver": parameters}), TakeGuesses(), None)
    settings = read(tmp_path, drafted.text)
    assert settings.base is not None
    assert (settings.base.forward.maximum, settings.base.command.frame) == (0.1, "chassis")
    assert "cmd_vel_timeout is 0.25 s" in drafted.text


def test_a_controller_without_a_timeout_is_marked(tmp_path: Path) -> None:
    graph = replace(base_graph(), parameters={"/driver": {"cmd_vel_timeout": 0.0}})
    assert "cmd_vel_timeout is 0 s, which should be above 0" in draft(graph, Person(), None).text


def test_slow_odometry_gets_a_longer_timeout(tmp_path: Path) -> None:
    graph = base_graph()
    graph = replace(graph, heard={"/odom": replace(graph.heard["/odom"], rate=4.0)})
    settings = read(tmp_path, draft(graph, TakeGuesses(), None).text)
    assert settings.base is not None
    assert settings.base.odometry.timeout == 2.0


def test_another_publisher_on_the_command_topic_is_named() -> None:
    both = Topic(
        "/cmd_vel", published("/cmd_vel", TWIST, "/navigation").publishers, taken("/cmd_vel", TWIST).subscribers
    )
    graph = base_graph()
    graph = replace(graph, topics={**graph.topics, "/cmd_vel": both})
    assert "/navigation publishes there too: use a mux" in draft(graph, TakeGuesses(), None).text


def test_simulated_time_is_noticed(tmp_path: Path) -> None:
    graph = base_graph(published("/clock", "rosgraph_msgs/msg/Clock"), published("/image", IMAGE))
    heard = {**graph.heard, "/image": Heard(count=9, rate=10.0, width=64, height=48, encoding="rgb8", stamped=True)}
    settings = read(tmp_path, draft(replace(graph, heard=heard), TakeGuesses(), None).text)
    assert settings.use_sim_time
    assert settings.cameras[0].captured == "arrival"


def two_robots() -> Graph:
    one, two = base_graph(namespace="/robot1"), base_graph(namespace="/robot2")
    shared = topics(published("/map_odom", ODOMETRY))
    return Graph({**one.topics, **two.topics, **shared}, {**one.heard, **two.heard})


def test_several_robots_are_told_apart_by_their_namespaces(tmp_path: Path) -> None:
    assert robots(two_robots()) == ["/robot1", "/robot2"]
    for drafted in (
        draft(two_robots(), TakeGuesses(), "/robot2"),
        draft(two_robots(), Person(There_are_several_robots=1), None),
    ):
        settings = read(tmp_path, drafted.text)
        assert settings.name == "robot2"
        assert settings.base is not None
        assert (settings.base.command.topic, settings.base.odometry.topic) == ("/robot2/cmd_vel", "/robot2/odom")
        assert "/robot1" not in drafted.text


def test_nobody_guesses_which_of_several_robots_is_meant() -> None:
    with pytest.raises(SeveralRobots, match="/robot1, /robot2. Name one with --namespace"):
        draft(two_robots(), TakeGuesses(), None)


def test_a_topic_that_a_person_chose_is_no_guess(tmp_path: Path) -> None:
    graph = base_graph(taken("/cmd_vel_teleop", TWIST))
    guessed = draft(graph, TakeGuesses(), None)
    chosen = draft(graph, Person(Which_topic_drives_the_base=1), None)
    settings = read(tmp_path, chosen.text)
    assert settings.base is not None
    assert (settings.base.command.topic, settings.base.command.message) == ("/cmd_vel_teleop", "Twist")
    assert "CHECK: taken by /driver; not /cmd_vel_teleop" in guessed.text
    assert "# taken by /driver; not /cmd_vel" in chosen.text


def test_controllers_of_one_robot_are_not_several_robots() -> None:
    graph = Graph(
        topics(
            taken("/diff_drive_controller/cmd_vel", TWIST),
            published("/diff_drive_controller/odom", ODOMETRY),
            taken("/arm_controller/joint_trajectory", TRAJECTORY),
            published("/joint_states", JOINT_STATE),
        )
    )
    assert robots(graph) == []


def test_a_graph_without_a_command_topic_says_what_was_seen() -> None:
    with pytest.raises(NothingToDrive, match=r"no node subscribes to Twist.*Seen: /scan"):
        draft(Graph(topics(published("/scan", SCAN))), TakeGuesses(), None)


def test_a_base_without_odometry_is_not_driven() -> None:
    with pytest.raises(NothingToDrive, match="no odometry is published"):
        draft(Graph(topics(taken("/cmd_vel", TWIST))), TakeGuesses(), None)


def test_joints_are_those_that_the_controller_names_in_its_order(tmp_path: Path) -> None:
    graph = arm_graph("/arm/joint_trajectory", TRAJECTORY, joints=["wrist", "elbow"])
    settings = read(tmp_path, draft(graph, TakeGuesses(), None).text)
    assert settings.arm is not None
    assert [joint.name for joint in settings.arm.joints] == ["wrist", "elbow"]


def test_without_such_a_parameter_joints_that_look_like_an_arms_are_guessed(tmp_path: Path) -> None:
    drafted = draft(arm_graph("/arm/joint_trajectory", TRAJECTORY), TakeGuesses(), None)
    settings = read(tmp_path, drafted.text)
    assert settings.arm is not None
    assert [joint.name for joint in settings.arm.joints] == ["elbow", "wrist"]
    assert "CHECK: the controller has to move exactly these joints." in drafted.text


@pytest.mark.parametrize(
    ("topic", "interface", "drives"),
    [
        ("/arm/commands", "velocity", True),
        ("/arm_velocity_controller/commands", None, True),
        ("/arm_velocity_controller/commands", "position", False),
        ("/arm/commands", None, False),
    ],
)
def test_numbers_are_sent_only_to_a_controller_of_velocities(
    topic: str, interface: str | None, drives: bool, tmp_path: Path
) -> None:
    parameters: dict[str, str | list[str]] = {"joints": ["elbow"]}
    if interface is not None:
        parameters["interface_name"] = interface
    graph = arm_graph(topic, FLOATS, **parameters)
    if not drives:
        with pytest.raises(NothingToDrive):
            draft(graph, TakeGuesses(), None)
        return
    settings = read(tmp_path, draft(graph, TakeGuesses(), None).text)
    assert settings.arm is not None
    assert settings.arm.command.message == "Float64MultiArray"


def test_velocities_in_an_order_that_is_not_known_are_not_sent() -> None:
    with pytest.raises(NothingToDrive, match="in what order, could not be found out"):
        draft(arm_graph("/arm_velocity_controller/commands", FLOATS), TakeGuesses(), None)


def test_an_arm_that_takes_joint_states_as_commands_is_found_and_marked(tmp_path: Path) -> None:
    drafted = draft(arm_graph("/joint_command", JOINT_STATE), TakeGuesses(), None)
    settings = read(tmp_path, drafted.text)
    assert settings.arm is not None
    assert (settings.arm.command.topic, settings.arm.command.message) == ("/joint_command", "JointState")
    assert [joint.name for joint in settings.arm.joints] == ["elbow", "wrist"]
    (line,) = (line for line in drafted.text.splitlines() if "topic: /joint_command" in line)
    assert "CHECK" in line


def test_what_listens_to_the_states_of_joints_is_no_arm() -> None:
    listeners = topics(
        published("/joint_states", JOINT_STATE),
        taken("/joint_states", JOINT_STATE, "/robot_state_publisher"),
        taken("/joint_states_filtered", JOINT_STATE, "/plotter"),
    )
    with pytest.raises(NothingToDrive, match="JointState of commands"):
        draft(Graph(listeners), TakeGuesses(), None)


def test_a_trajectory_is_likelier_than_a_joint_state(tmp_path: Path) -> None:
    arm = arm_graph("/arm_controller/joint_trajectory", TRAJECTORY, joints=["elbow"])
    graph = replace(arm, topics={**arm.topics, **topics(taken("/joint_command", JOINT_STATE, "/simulator"))})
    settings = read(tmp_path, draft(graph, TakeGuesses(), None).text)
    assert settings.arm is not None
    assert settings.arm.command.message == "JointTrajectory"


def test_servo_is_driven_where_it_is_all_there_is(tmp_path: Path) -> None:
    graph = Graph(
        topics(
            taken("/servo_node/delta_twist_cmds", TWIST_STAMPED, "/servo_node"),
            published("/servo_node/status", INT8),
            published("/joint_states", JOINT_STATE),
        ),
        {"/joint_states": Heard(count=9, rate=50.0, joints=("elbow", "wrist"))},
    )
    drafted = draft(graph, TakeGuesses(), None)
    settings = read(tmp_path, drafted.text)
    assert settings.base is None, "twists of a tool are not those of a base"
    assert settings.servo is not None
    assert settings.servo.joints == ("elbow", "wrist")
    assert settings.servo.status is not None
    assert settings.servo.status.message == "Int8"
    assert "CHECK: Servo's parameter command_in_type is not known" in drafted.text
    known = replace(graph, parameters={"/servo_node": {"moveit_servo.command_in_type": "speed_units"}})
    assert "command_in_type" not in draft(known, TakeGuesses(), None).text


def test_pictures_that_the_bridge_cannot_read_are_left_out_and_named(tmp_path: Path) -> None:
    def picture(encoding: str, stamped: bool = True) -> Heard:
        return Heard(count=9, rate=29.7, width=250, height=250, encoding=encoding, stamped=stamped)

    graph = base_graph(
        published("/front/image_raw", IMAGE),
        published("/front/image_raw/compressed", COMPRESSED),
        published("/depth/image_raw", IMAGE),
        published("/rear/image_raw/compressed", COMPRESSED),
        published("/silent/image_raw", IMAGE),
    )
    heard = {
        **graph.heard,
        "/front/image_raw": picture("rgb8"),
        "/front/image_raw/compressed": picture("jpeg"),
        "/depth/image_raw": picture("16UC1"),
        "/rear/image_raw/compressed": picture("jpeg", stamped=False),
    }
    drafted = draft(replace(graph, heard=heard), TakeGuesses(), None)
    cameras = read(tmp_path, drafted.text).cameras
    assert [(camera.name, camera.message, camera.captured) for camera in cameras] == [
        ("front", "Image", "header"),
        ("rear", "CompressedImage", "arrival"),
    ]
    assert drafted.remarks == ["/depth/image_raw: pictures in encoding '16UC1' are not shown"]


def test_a_scanner_that_hangs_upside_down_is_marked(tmp_path: Path) -> None:
    urdf = URDF.replace('rpy="0 0 1.5708"', 'rpy="3.14159 0 0"')
    graph = base_graph(published("/scan", SCAN), published("/ft", WRENCH))
    heard = {
        **graph.heard,
        "/scan": Heard(count=9, rate=5.0, frame="laser", range_min=0.1, range_max=6.0),
        "/ft": Heard(count=9, rate=100.0),
    }
    graph = replace(graph, heard=heard, descriptions={"/robot_description": urdf})
    drafted = draft(graph, TakeGuesses(), None)
    assert "CHECK: frame 'laser' is tilted or upside down" in drafted.text
    settings = read(tmp_path, drafted.text)
    assert settings.ranges is not None
    assert settings.ranges.body is None
    assert (settings.ranges.timeout, settings.ranges.range_max) == (1.6, 6.0)
    assert settings.wrench is not None


def test_a_scanner_is_where_the_urdf_has_it_also_without_the_other_bodies(tmp_path: Path) -> None:
    graph = base_graph(published("/scan", SCAN))
    heard = {**graph.heard, "/scan": Heard(count=9, rate=5.0, frame="laser", range_min=0.1, range_max=6.0)}
    drafted = draft(replace(graph, heard=heard, descriptions={"/robot_description": URDF}), TakeGuesses(), None)
    for text in (drafted.text, drafted.without_bodies):
        settings = read(tmp_path, text)
        assert settings.ranges is not None
        (scanner,) = (body for body in settings.bodies if body.name == settings.ranges.body)
        assert (scanner.parent, list(scanner.position)) == ("base", [0.2, 0, 0.2])
    assert len(read(tmp_path, drafted.text).bodies) > len(read(tmp_path, drafted.without_bodies).bodies)


def test_a_description_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    for text, complaint in (("<robot", "is not XML"), ("", "no message came")):
        graph = replace(base_graph(), descriptions={"/robot_description": text})
        drafted = draft(graph, TakeGuesses(), None)
        assert complaint in drafted.remarks[0]
        read(tmp_path, drafted.text)


def test_names_from_the_graph_can_neither_end_a_line_nor_mean_something_else(tmp_path: Path) -> None:
    graph = base_graph()
    evil = "base\nhold: 5 # {yes}"
    heard = {"/odom": replace(graph.heard["/odom"], child_frame=evil)}
    settings = read(tmp_path, draft(replace(graph, heard=heard), TakeGuesses(), None).text)
    assert settings.hold == 0.5
    assert settings.base is not None
    assert settings.base.command.frame == evil
