import msgspec

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.framing import MAX_CONTROL_FRAME
from lockstep.protocol.messages import Hello, decode_message, encode_message
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION


def test_a_description_survives_the_wire_inside_a_hello() -> None:
    hello = Hello(role="robot", epoch="e", description=DESCRIPTION)
    data = encode_message(hello)
    assert decode_message(data) == hello
    assert len(data) < MAX_CONTROL_FRAME


def test_a_description_survives_json() -> None:
    assert msgspec.json.decode(msgspec.json.encode(DESCRIPTION), type=RobotDescription) == DESCRIPTION


def test_only_name_label_and_axes_must_be_given() -> None:
    axis = Axis(name="a", label="A", unit="m/s", minimum=-1, maximum=1, slew=1, brake=10)
    description = RobotDescription(name="r", label="R", axes=(axis,))
    assert axis.rest == 0.0
    assert (description.hold, description.max_event_age, description.max_event_rate) == (0.3, 2.0, 25.0)
