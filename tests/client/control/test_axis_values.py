import pytest

from lockstep.client.control.axis_values import Values, command_values
from lockstep.client.errors import CommandError
from lockstep.protocol.description import Axis

AXES = (
    Axis(name="wheel", label="Wheel", unit="m/s", minimum=-1, maximum=1, slew=1, brake=4),
    Axis(name="joint", label="Joint", unit="rad", minimum=-1, maximum=1, slew=1, brake=4, kind="goal", reach=0.5),
)


@pytest.mark.parametrize(
    ("values", "command"),
    [
        ([1, 0.5], [1.0, 0.5]),
        ([0.0, None], [0.0, None]),
        ({"joint": 0.5}, [0.0, 0.5]),
        ({"wheel": 0.5}, [0.5, None]),
        ({}, [0.0, None]),
    ],
)
def test_axes_without_a_value_are_at_rest_or_stay(values: Values, command: list[float | None]) -> None:
    assert command_values(AXES, values) == command


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"elbow": 1.0}, "no axis elbow; there are wheel, joint"),
        ([1.0], "1 values for 2 axes"),
        ([None, 1.0], "wheel has no value"),
        ([0.0, float("nan")], "NaN or infinite"),
    ],
)
def test_values_that_no_robot_takes_are_refused_by_name(values: Values, why: str) -> None:
    with pytest.raises(CommandError, match=why):
        command_values(AXES, values)
