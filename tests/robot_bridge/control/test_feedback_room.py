import math
import random
import string

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.protocol.feedback_size import MAX_FEEDBACK_BYTES, is_too_large
from lockstep.protocol.messages import MAX_FAULTS, MAX_LIMITS, MAX_RAYS, Feedback, StopState
from lockstep.robot_bridge.control.feedback_room import Texts, within_size
from lockstep.robot_bridge.robots.base import Measurement

QUIET = Measurement(axes=[0.0], joints=[0.0], wrench=[], ranges=[], at_rest=True, faults=[])
STOP = StopState(stopped=True, by="\x00" * 500, reason="\x00" * 500)


def feedback(measured: Measurement, ranges: list[float], texts: Texts) -> Feedback:
    return Feedback(
        event=2**31 - 1,
        issue=2**31 - 1,
        time=1e9 / 3,
        axes=measured.axes,
        joints=measured.joints,
        wrench=measured.wrench,
        ranges=ranges,
        faults=texts.faults,
        unknown=texts.unknown,
        limits=texts.limits,
        stop=STOP,
    )


def test_what_fits_is_as_it_was() -> None:
    measured = QUIET._replace(ranges=[1 / 3], faults=["no camera"])
    assert within_size(measured, [None], ["joint"], ["zone"]) == ([1 / 3], (["no camera"], ["joint"], ["zone"], 0))


def test_512_long_limits_leave_room_for_the_feedback_and_the_others_are_counted() -> None:
    limits = [f"{number}{'l' * 490}" for number in range(MAX_LIMITS)]
    ranges, texts = within_size(QUIET, [], [], limits)
    assert texts.limits == limits[: len(texts.limits)]
    assert 90 < len(texts.limits) == MAX_LIMITS - texts.left_out
    assert not is_too_large(feedback(QUIET, ranges, texts))
    assert is_too_large(feedback(QUIET, ranges, texts._replace(limits=limits)))


def test_the_newest_faults_have_room_before_limits() -> None:
    measured = QUIET._replace(faults=[f"{number}{'f' * 600}" for number in range(200)])
    _, texts = within_size(measured, [], [], ["l" * 500] * MAX_LIMITS)
    assert len(texts.faults) == MAX_FAULTS
    assert texts.faults[-1].startswith("199f")


def test_a_ring_of_all_rays_has_room_in_tenths_of_a_millimetre() -> None:
    ranges = [random.Random(number).uniform(0, 100) for number in range(MAX_RAYS)]
    measured = QUIET._replace(ranges=ranges)
    rounded, texts = within_size(measured, [], [], [])
    assert is_too_large(feedback(measured, ranges, texts)), "no peer would have taken it"
    assert not is_too_large(feedback(measured, rounded, texts))
    assert all(math.isclose(a, b, abs_tol=5.1e-5) for a, b in zip(ranges, rounded, strict=True))


def test_a_fault_with_bytes_that_are_no_text_can_be_sent() -> None:
    _, texts = within_size(QUIET._replace(faults=["/dev/caf\udce9"]), [], [], [])
    assert texts.faults == ["/dev/caf?"]


WORDS = st.lists(st.text(string.ascii_letters + "\x00é\U0001f600", max_size=500), max_size=MAX_LIMITS + 100)


@settings(max_examples=40, deadline=None)
@given(faults=WORDS, unknown=WORDS, limits=WORDS)
def test_whatever_there_is_a_console_takes_it(faults: list[str], unknown: list[str], limits: list[str]) -> None:
    measured = QUIET._replace(faults=faults, axes=[1 / 3] * 256, joints=[1 / 3] * 256)
    ranges, texts = within_size(measured, [1 / 3] * 256, unknown, limits)
    made = feedback(measured, ranges, texts)
    assert len(msgspec.json.encode(made)) <= MAX_FEEDBACK_BYTES
    assert not is_too_large(made)
