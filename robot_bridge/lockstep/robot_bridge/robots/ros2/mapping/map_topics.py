"""Reads the map of a ROS 2 robot: the grid, where the odometry's frame is on it, and the path."""

import math
from collections.abc import Callable
from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow, PlanarPose
from lockstep.robot_bridge.robots.ros2.mapping.frame_listener import FrameListener
from lockstep.robot_bridge.robots.ros2.mapping.transforms import composed, inverted, planar
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import MapTopics

__all__ = ["BadMap", "MapReader", "grid_of"]

MOST_CELLS = 1 << 26  # of a map that is read: 64 MiB
MOST_POINTS = 100_000  # of a path that is read
SAME: PlanarPose = (0.0, 0.0, 0.0)

Points = tuple[tuple[float, float], ...]


class BadMap(ValueError):
    """A message that contradicts itself; the text names the fault, without figures, for counting."""


def grid_of(message: Any, now: float) -> GridMap:
    """Return the map of a nav_msgs/OccupancyGrid.

    Raises:
        BadMap: it contradicts itself, or is too large.
    """
    info = message.info
    width, height, resolution = int(info.width), int(info.height), float(info.resolution)
    if not (width > 0 and height > 0 and width * height <= MOST_CELLS):
        raise BadMap("a map without cells, or with far too many")
    if len(message.data) != width * height:
        raise BadMap("a map with another number of cells than it says")
    origin = planar(info.origin.position, info.origin.orientation)
    if origin is None or not (math.isfinite(resolution) and 0 < resolution <= 100):
        raise BadMap("a map without a place or a scale")
    return GridMap(width, height, resolution, origin, message.data.tobytes(), now)  # -1 (not known) is 255 as a byte


class MapReader:
    """The node's thread writes what came, the bridge's loop reads it."""

    def __init__(
        self,
        ros: RosSide,
        settings: MapTopics,
        odometry: Callable[[float], PlanarPose | None],
        frames: FrameListener | None,
    ) -> None:
        """`odometry`: the base's measured pose now, given the time; None if it is not known.

        `frames`: needed where the place comes from tf.

        Raises:
            RobotUnavailable: a message is not installed.
        """
        self._settings = settings
        self._odometry = odometry
        self._map: GridMap | None = None
        self._maps: Newest[bool] = Newest(settings.topic, math.inf)
        self._frames = frames
        self._place: tuple[PlanarPose, float] | None = None  # of the odometry's frame on the map, and when that came
        self._path: Newest[Points] = Newest(settings.path, math.inf)
        grids = ros.interface("nav_msgs/msg/OccupancyGrid")
        ros.subscribe(grids, settings.topic, self._take_map, kept=settings.durable)
        if settings.path:
            ros.subscribe(ros.interface("nav_msgs/msg/Path"), settings.path, self._take_path)
        place = settings.place
        if place.source == "topic":
            ros.subscribe(ros.interface(f"geometry_msgs/msg/{place.message}"), place.topic, self._take_place)

    def grid_map(self) -> GridMap | None:
        return self._map

    def navigation(self, goal: PlanarPose | None) -> NavigationNow:
        """Return where the robot is. The path is only shown with a goal: planners do not take it back."""
        path = self._path.last()
        if goal is None or path is None:
            return NavigationNow(frame=self._frame(clock.now()), goal=goal)
        return NavigationNow(self._frame(clock.now()), goal, path.value, path.time)

    def faults(self, now: float) -> list[str]:
        """Return why the map or the path cannot be used; a map that has not come yet is no fault."""
        return [fault for topic in (self._maps, self._path) for fault in topic.faults(now) if "×" in fault]

    def _frame(self, now: float) -> PlanarPose | None:
        place = self._settings.place
        if place.source == "same":
            return SAME
        if place.source == "tf":
            if self._frames is None:
                return None
            return self._frames.pose(self._settings.frame, place.odometry, now, place.timeout)
        known = self._place
        return None if known is None or now - known[1] > place.timeout else known[0]

    def _take_map(self, message: Any) -> None:
        now = clock.now()
        try:
            self._map = grid_of(message, now)
        except BadMap as error:
            self._maps.refuse(str(error), now)

    def _take_path(self, message: Any) -> None:
        now = clock.now()
        if len(message.poses) > MOST_POINTS:
            self._path.refuse("a path with far too many points", now)
            return
        points = tuple((float(each.pose.position.x), float(each.pose.position.y)) for each in message.poses)
        if message.header.frame_id.lstrip("/") not in ("", self._settings.frame):
            self._path.refuse("a path in another frame than the map's", now)
        elif all(math.isfinite(number) for point in points for number in point):
            self._path.put(points, now)
        else:
            self._path.refuse("a path with a number that is none", now)

    def _take_place(self, message: Any) -> None:
        """The robot's pose on the map, with its odometry, says where the odometry's frame is."""
        now = clock.now()
        told = message.pose
        told = told.pose if hasattr(told, "pose") else told  # with a covariance beside it
        pose = planar(told.position, told.orientation)
        odometry = self._odometry(now)
        if pose is not None and odometry is not None:
            self._place = composed(pose, inverted(odometry)), now
