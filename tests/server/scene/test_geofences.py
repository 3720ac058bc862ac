from collections.abc import Iterator

import msgspec
import pytest
import rich
import viser

from lockstep.protocol.description import Geofence
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from lockstep.robot_bridge.robots.planar.room import CHARGER
from lockstep.server.scene.geofences import ACTING, CALM, KEEP_IN, KEEP_OUT
from lockstep.server.scene.model import SceneModel


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    rich.get_console().quiet = True
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


def test_every_zone_is_drawn_and_gets_thick_while_it_acts(server: viser.ViserServer) -> None:
    model = SceneModel(server, DESCRIPTION)
    lines = model.fences.lines
    assert set(lines) == {"room", "charger"}
    assert tuple(lines["room"].colors.reshape(-1, 3)[0]) == KEEP_IN
    assert tuple(lines["charger"].colors.reshape(-1, 3)[0]) == KEEP_OUT
    corners = {(round(float(x), 3), round(float(y), 3)) for x, y, _ in lines["charger"].points.reshape(-1, 3)}
    left, low, right, high = CHARGER
    assert corners == {(left, low), (right, low), (right, high), (left, high)}
    feedback = {"event": 2, "issue": 1, "time": 0.0, "axes": [0.0] * 3, "joints": [0.0] * 3, "ranges": [1.0] * 24}
    for acting, width in ((["charger", "unknown"], ACTING), ([], CALM)):
        model.pose(Feedback(**feedback, limits=acting))  # type: ignore[arg-type]
        assert lines["charger"].thickness == width
        assert lines["room"].thickness == CALM


def test_a_zone_without_corners_is_left_out(server: viser.ViserServer) -> None:
    empty = Geofence(name="empty", label="", kind="keep_in", polygon=())
    model = SceneModel(server, msgspec.structs.replace(DESCRIPTION, geofences=(empty,)))
    assert model.fences.lines == {}
    model.fences.show(["empty"])
