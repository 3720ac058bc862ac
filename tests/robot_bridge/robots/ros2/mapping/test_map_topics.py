"""The map of a ROS 2 robot, from messages that a node sends: the grid, the path, and where the odometry is on it."""

import array
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.ros2.mapping.map_topics import BadMap, MapReader, grid_of
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import MapPlace, MapTopics

QUARTER = math.pi / 2


class Topics:
    """Stands for the side of ROS: keeps what would be called with a message."""

    def __init__(self) -> None:
        self.takes: dict[tuple[str, str], Callable[[Any], None]] = {}

    def interface(self, name: str) -> str:
        return name

    def subscribe(self, message: str, topic: str, take: Callable[[Any], None], *, kept: bool = False) -> None:
        self.takes[message, topic] = take


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The time, s, of the bridge's clock."""
    found = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr("lockstep.robot_bridge.control.clock.now", lambda: found.seconds)
    return found


def reader(settings: MapTopics, odometry: PlanarPose | None = (0.0, 0.0, 0.0)) -> tuple[Topics, MapReader]:
    ros = Topics()
    return ros, MapReader(cast(RosSide, ros), settings, lambda _now: odometry, None)


def posed(x: float, y: float, yaw: float) -> SimpleNamespace:
    """A geometry_msgs/Pose."""
    orientation = SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return SimpleNamespace(position=SimpleNamespace(x=x, y=y, z=0.0), orientation=orientation)


def grid(width: int = 2, height: int = 1, data: bytes = b"\x00\xff", **info: Any) -> SimpleNamespace:
    facts = {"width": width, "height": height, "resolution": 0.05, "origin": posed(-1.0, 2.0, 0.0)}
    return SimpleNamespace(info=SimpleNamespace(**(facts | info)), data=array.array("b", data))


@pytest.mark.parametrize("message", ["PoseWithCovarianceStamped", "PoseStamped"])
def test_a_pose_on_the_map_says_where_the_frame_of_the_odometry_is(now: SimpleNamespace, message: Any) -> None:
    """The robot is 1 m ahead in its odometry, and at (3, 4), turned to the left, on the map."""
    place = MapPlace(source="topic", topic="/amcl_pose", message=message)
    ros, maps = reader(MapTopics(place=place), odometry=(1.0, 0.0, 0.0))
    assert maps.navigation(None).frame is None, "nobody has said it"
    told = posed(3.0, 4.0, QUARTER)
    pose = SimpleNamespace(pose=told) if message == "PoseWithCovarianceStamped" else told
    ros.takes[f"geometry_msgs/msg/{message}", "/amcl_pose"](SimpleNamespace(pose=pose))
    assert maps.navigation(None).frame == pytest.approx((3.0, 3.0, QUARTER))
    now.seconds += 9.9
    assert maps.navigation(None).frame is not None
    now.seconds += 0.2
    assert maps.navigation(None).frame is None, "it is too old"


def test_a_pose_on_the_map_says_nothing_while_the_odometry_is_not_known_or_it_is_none(now: SimpleNamespace) -> None:
    place = MapPlace(source="topic", message="PoseStamped")
    for odometry, x in ((None, 1.0), ((0.0, 0.0, 0.0), math.nan)):
        ros, maps = reader(MapTopics(place=place), odometry)
        ros.takes["geometry_msgs/msg/PoseStamped", "/amcl_pose"](SimpleNamespace(pose=posed(x, 0.0, 0.0)))
        assert maps.navigation(None).frame is None


def test_an_odometry_in_the_maps_frame_needs_nobody_to_say_so(now: SimpleNamespace) -> None:
    _, maps = reader(MapTopics(place=MapPlace(source="same")))
    assert maps.navigation(None).frame == (0.0, 0.0, 0.0)
    _, maps = reader(MapTopics())
    assert maps.navigation(None).frame is None, "tf has said nothing"


def test_a_grid_becomes_a_map_and_one_that_contradicts_itself_is_counted(now: SimpleNamespace) -> None:
    ros, maps = reader(MapTopics())
    take = ros.takes["nav_msgs/msg/OccupancyGrid", "/map"]
    take(grid())
    found = maps.grid_map()
    assert found is not None
    assert (found.width, found.height, found.origin, found.cells) == (2, 1, (-1.0, 2.0, 0.0), b"\x00\xff")
    take(grid(width=3))
    assert maps.grid_map() is found
    (fault,) = maps.faults(now.seconds)
    assert "a map with another number of cells than it says" in fault


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (grid(width=0, data=b""), "without cells"),
        (grid(width=1 << 14, height=1 << 14), "far too many"),
        (grid(width=-1, height=-2), "without cells"),
        (grid(data=b"\x00"), "another number of cells"),
        (grid(resolution=0.0), "without a place or a scale"),
        (grid(resolution=math.nan), "without a place or a scale"),
        (grid(origin=posed(math.inf, 0.0, 0.0)), "without a place or a scale"),
    ],
)
def test_a_grid_that_is_no_map_is_refused_by_name(message: Any, words: str) -> None:
    with pytest.raises(BadMap, match=words):
        grid_of(message, 0.0)


def path(*points: tuple[float, float], frame: str = "map") -> SimpleNamespace:
    poses = [SimpleNamespace(pose=posed(x, y, 0.0)) for x, y in points]
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), poses=poses)


def test_a_path_is_shown_while_there_is_a_goal(now: SimpleNamespace) -> None:
    ros, maps = reader(MapTopics())
    take = ros.takes["nav_msgs/msg/Path", "/plan"]
    take(path((0.0, 0.0), (1.0, 2.0), frame="/map"))
    assert maps.navigation(None).path == ()
    assert maps.navigation((1.0, 2.0, 0.0)).path == ((0.0, 0.0), (1.0, 2.0))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (path((0.0, 0.0), frame="odom"), "a path in another frame"),
        (path((0.0, math.nan)), "a number that is none"),
        (path(*[(0.0, 0.0)] * 100_001), "far too many points"),
    ],
)
def test_a_path_that_cannot_be_shown_is_counted_and_the_one_before_stays(
    now: SimpleNamespace, message: Any, words: str
) -> None:
    ros, maps = reader(MapTopics())
    take = ros.takes["nav_msgs/msg/Path", "/plan"]
    take(path((1.0, 1.0)))
    take(message)
    assert maps.navigation((1.0, 1.0, 0.0)).path == ((1.0, 1.0),)
    assert words in maps.faults(now.seconds)[0]


def test_without_a_path_topic_there_is_none(now: SimpleNamespace) -> None:
    ros, maps = reader(MapTopics(path=""))
    assert set(ros.takes) == {("nav_msgs/msg/OccupancyGrid", "/map")}
    assert maps.navigation((1.0, 1.0, 0.0)).path == ()
