"""The robot of robot_node.py with services, batteries and diagnostics. Run with ROS' Python.

More lines on standard input: `charge X` (NaN: unknown), `level NAME N` (of a component), `press` (its hardware stop).
"""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.callback_groups import ReentrantCallbackGroup
from robot_node import RobotNode, main  # type: ignore[import-not-found]  # beside this file, which is run as a script
from sensor_msgs.msg import BatteryState, Temperature
from std_msgs.msg import Bool, Float32, Float64, Int32, String
from std_srvs.srv import SetBool, Trigger

EVERY = 0.1  # s


class ServingRobot(RobotNode):  # type: ignore[misc]
    def __init__(self, log: Path) -> None:
        super().__init__(log)
        self._charge, self._levels = 0.8, {"motors: left": 0, "lidar": 0}
        self._battery = self.create_publisher(BatteryState, "/battery_state", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._modes = self.create_publisher(String, "/mode", 10)
        self._stops = self.create_publisher(Bool, "/emergency_stop", 10)
        self._pressed = False
        self._readings = [
            (self.create_publisher(kind, topic, 10), kind, value)
            for kind, topic, value in (
                (Float32, "/load", 0.25),
                (Float64, "/depth", -3.5),
                (Int32, "/parts", 7),
                (Bool, "/door", True),
            )
        ]
        self._heat = self.create_publisher(Temperature, "/motor_temperature", 10)
        self._grids = self.create_publisher(OccupancyGrid, "/map", 10)
        self._places = self.create_publisher(PoseWithCovarianceStamped, "/amcl_pose", 10)
        self._poses = self.create_publisher(PoseStamped, "/pose", 10)
        group = ReentrantCallbackGroup()
        self.create_service(SetBool, "/light", self._light, callback_group=group)
        self.create_service(Trigger, "/beep", self._beep, callback_group=group)
        self.create_service(Trigger, "/calibrate", self._calibrate, callback_group=group)
        self.create_timer(EVERY, self._report)

    def tell(self, line: str) -> None:
        verb, *words = line.split(" ")
        if verb == "charge":
            self._charge = float(words[0])
        elif verb == "press":
            self._pressed = True
        elif verb == "level":
            self._levels[" ".join(words[:-1])] = int(words[-1])
        else:
            super().tell(line)

    def _light(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.note("light", on=request.data)
        response.success, response.message = True, "on" if request.data else "off"
        return response

    def _beep(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.note("beep")
        response.success, response.message = True, "it\x1b[31m beeped"
        return response

    def _calibrate(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = False, "the lid is open"
        return response

    def _report(self) -> None:
        self._modes.publish(String(data="AUTO"))
        self._stops.publish(Bool(data=self._pressed))
        for publisher, kind, value in self._readings:
            publisher.publish(kind(data=value))
        heat = Temperature(temperature=61.5)
        heat.header.stamp = self.get_clock().now().to_msg()
        self._heat.publish(heat)
        self._say_place()
        battery = BatteryState()
        battery.header.stamp = self.get_clock().now().to_msg()
        battery.voltage, battery.percentage = 24.5, self._charge
        battery.charge = battery.capacity = float("nan")
        self._battery.publish(battery)
        for name, level in self._levels.items():  # each from a node of its own, as it were
            status = DiagnosticStatus(level=bytes([level]), name=name, message="" if level == 0 else "too hot")
            self._diagnostics.publish(DiagnosticArray(status=[status]))

    def _say_place(self) -> None:
        """A map of two cells, and the robot at (3, 4) on it, turned to the left; 1 m further by the other topic."""
        grid = OccupancyGrid(data=[0, 100])
        grid.info.width, grid.info.height, grid.info.resolution = 2, 1, 0.5
        grid.info.origin.orientation.w = 1.0
        self._grids.publish(grid)
        place = PoseStamped()
        place.pose.position.x, place.pose.position.y = 3.0, 4.0
        place.pose.orientation.z = place.pose.orientation.w = 0.5**0.5
        estimated = PoseWithCovarianceStamped(header=place.header)
        estimated.pose.pose = place.pose
        self._places.publish(estimated)
        place.pose.position.x = 4.0
        self._poses.publish(place)


if __name__ == "__main__":
    main(ServingRobot)
