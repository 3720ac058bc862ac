"""A command's goals, bounded to what the robot takes."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.pipe.reach import within_reach
from lockstep.protocol.description import Axis

PAN = Axis(name="pan", label="", unit="deg", minimum=-90, maximum=90, slew=60, brake=240, kind="goal", reach=30)
TURN = Axis(
    name="turn", label="", unit="deg", minimum=-180, maximum=180, slew=60, brake=240, kind="goal", reach=30, wrap=360
)
WHEEL = Axis(name="wheel", label="", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1)


def test_a_far_goal_is_as_near_as_the_robot_takes() -> None:
    assert within_reach((PAN,), [10.0], [], {"pan": 80.0}) == {"pan": 34.0}
    assert within_reach((PAN,), [10.0], [], {"pan": -80.0}) == {"pan": -14.0}


def test_the_applied_goal_may_stay_however_far_the_arm_hangs_below_it() -> None:
    assert within_reach((PAN,), [0.0], [29.0], {"pan": 29.0}) == {"pan": 29.0}
    assert within_reach((PAN,), [0.0], [None], {"pan": 29.0}) == {"pan": 24.0}


def test_a_near_goal_stays() -> None:
    assert within_reach((PAN, WHEEL), [10.0, 0.0], [], {"pan": 12.5, "wheel": 0.3}) == {"pan": 12.5, "wheel": 0.3}


def test_ranges_hold_for_all_axes() -> None:
    assert within_reach((PAN, WHEEL, TURN), [80.0, 0.0, 0.0], [], {"pan": 99, "wheel": -3, "turn": 170}) == {
        "pan": 90,
        "wheel": -1,
        "turn": 170,
    }


def test_an_axis_that_does_not_exist_stays_for_the_console_to_refuse() -> None:
    assert within_reach((PAN,), [0.0], [], {"tilt": 5.0}) == {"tilt": 5.0}


@given(st.floats(-90, 90), st.floats(-1e6, 1e6))
def test_a_bounded_goal_is_never_refused_as_a_jump(measured: float, wanted: float) -> None:
    goal = within_reach((PAN,), [measured], [], {"pan": wanted})["pan"]
    assert abs(goal - measured) <= PAN.reach
    assert PAN.minimum <= goal <= PAN.maximum
