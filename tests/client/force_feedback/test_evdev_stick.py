"""Force feedback by Linux' event interface, against a fake kernel at the level of its calls. No real stick was felt."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.force_feedback import EvdevStick, ForceFeedback, ForceFeedbackError, ForceSettings
from lockstep.client.force_feedback.stick_force import NO_FORCE, StickForce, contact_strength, ramped, stick_force
from lockstep.protocol.description import ForceFeeling, RobotDescription
from lockstep.protocol.messages import Feedback, StopState
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.client.force_feedback.fake_kernel import CONSTANT, DAMPER, SPRING, FakeKernel, Felt

SETTINGS = ForceSettings(strongest=0.5, spring=0.2, damper=0.1)
WALL = [-60.0, 0.0, 0.0, 0.0, 0.0, 0.0]
STEP = 0.05


def feedback(wrench: list[float], **parts: object) -> Feedback:
    return msgspec.structs.replace(Feedback(event=1, issue=1, time=0.0, axes=[0.0] * 3, wrench=wrench), **parts)


class Hand:
    """A stick on the fake's clock; its thread is not started, the test makes its steps."""

    def __init__(self, kernel: FakeKernel | None = None, settings: ForceSettings = SETTINGS) -> None:
        self.kernel = FakeKernel() if kernel is None else kernel
        self.stick = EvdevStick("/dev/input/event7", self.kernel)
        self.forces = ForceFeedback(self.stick, DESCRIPTION, settings, clock=lambda: self.kernel.now)

    def drive(self, seconds: float, wrench: list[float] | None = None) -> None:
        for _ in range(round(seconds / STEP)):
            self.kernel.now += STEP
            self.forces.felt(feedback(WALL if wrench is None else wrench), driving=True)
            self.forces.step()


def test_the_hand_is_pushed_as_the_robot_is() -> None:
    hand = Hand()
    hand.drive(0.5)
    felt = hand.kernel.felt()
    assert (felt.right, felt.ahead) == pytest.approx((0, -0.5), abs=0.01)
    assert felt.conditions == pytest.approx({SPRING: 0.2, DAMPER: 0.1}, abs=0.01)
    hand.drive(0.5, [0.0, -60.0, 0.0])
    assert hand.kernel.felt().right == pytest.approx(0.5, abs=0.01)


def test_a_stick_that_pushes_the_wrong_way_can_be_turned() -> None:
    hand = Hand(settings=ForceSettings(strongest=0.5, turned=True))
    hand.drive(0.5)
    assert hand.kernel.felt().ahead == pytest.approx(0.5, abs=0.01)


def test_every_effect_ends_within_hold_when_the_program_hangs() -> None:
    hand = Hand()
    hand.drive(2.0)
    assert hand.kernel.felt() != Felt()
    assert hand.kernel.felt(after=DESCRIPTION.hold) == Felt()
    assert all(effect.milliseconds <= 1000 * DESCRIPTION.hold for effect in hand.kernel.effects.values())


def test_old_feedback_is_not_felt() -> None:
    hand = Hand()
    hand.drive(0.5)
    for _ in range(round(DESCRIPTION.hold / STEP)):
        hand.kernel.now += STEP
        hand.forces.step()
        assert hand.kernel.felt() != Felt()
    hand.kernel.now += STEP
    hand.forces.step()
    assert hand.kernel.felt() == Felt()


@pytest.mark.parametrize(
    ("parts", "driving"),
    [({}, False), ({"stop": StopState(stopped=True)}, True), ({"stop": StopState(locked_out="key switch")}, True)],
)
def test_nothing_is_felt_without_driving_or_while_the_robot_is_stopped(parts: dict[str, object], driving: bool) -> None:
    hand = Hand()
    hand.drive(0.5)
    hand.forces.felt(feedback(WALL, **parts), driving=driving)
    hand.forces.step()
    assert hand.kernel.felt() == Felt()
    calls = hand.kernel.calls
    hand.forces.step()
    assert hand.kernel.calls == calls, "nothing is said to a stick that is free"


def test_the_thread_tells_the_stick_and_frees_it_at_the_end() -> None:
    hand = Hand()
    with hand.forces as forces:
        forces.felt(feedback(WALL), driving=True)
        hand.kernel.until(lambda: hand.kernel.felt().ahead < 0)
        forces.stop()
        hand.kernel.until(lambda: hand.kernel.felt() == Felt())
        forces.felt(feedback(WALL), driving=True)
    assert hand.kernel.felt() == Felt()
    hand.stick.close()
    hand.stick.close()
    assert hand.kernel.effects == {}


def test_a_stick_that_is_unplugged_is_a_named_failure() -> None:
    hand = Hand()
    hand.drive(0.2)
    hand.kernel.plugged = False
    with hand.forces:
        pass
    assert "takes no effect" in str(hand.forces.failure)
    hand.stick.close()


@pytest.mark.parametrize(
    ("kernel", "words"),
    [
        (FakeKernel(plugged=False), "cannot be opened"),
        (FakeKernel(codes=(SPRING,)), "no constant force"),
        (FakeKernel(codes=()), "no constant force"),
    ],
)
def test_a_device_that_cannot_push_says_why(kernel: FakeKernel, words: str) -> None:
    with pytest.raises(ForceFeedbackError, match=words):
        EvdevStick("/dev/input/event7", kernel)
    assert not kernel.opened


def test_a_device_without_room_is_a_named_error_and_one_without_springs_pushes() -> None:
    full = Hand(FakeKernel(room=0))
    full.forces.felt(feedback(WALL), driving=True)
    with pytest.raises(ForceFeedbackError, match="No space left"):
        full.forces.step()
    plain = Hand(FakeKernel(codes=(CONSTANT,)))
    plain.drive(0.5)
    assert plain.kernel.gain == 0
    assert [effect.code for effect in plain.kernel.effects.values()] == [CONSTANT]


def test_a_file_that_is_no_stick_is_refused() -> None:
    with pytest.raises(ForceFeedbackError):
        EvdevStick("/dev/null")


@pytest.mark.parametrize("name", ["strongest", "spring", "damper"])
@pytest.mark.parametrize("share", [-0.1, 1.1, math.nan])
def test_a_share_beyond_the_device_is_refused(name: str, share: float) -> None:
    with pytest.raises(ValueError, match=name):
        ForceSettings(**{name: share})  # type: ignore[arg-type]  # of the three names above


@given(
    steps=st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True, width=32),
            st.floats(-500, 500),
            st.sampled_from(["drive", "let go", "hang"]),
            st.floats(0.001, 0.4),
        ),
        max_size=40,
    )
)
def test_whatever_is_measured_the_force_is_bounded_grows_slowly_and_ends(
    steps: list[tuple[float, float, str, float]],
) -> None:
    hand = Hand()
    last = 0.0
    for x, y, what, passed in steps:
        hand.kernel.now += passed
        if what != "hang":
            hand.forces.felt(feedback([x, y, 0.0]), driving=what == "drive")
        hand.forces.step()
        felt = hand.kernel.felt()
        size = math.hypot(felt.right, felt.ahead)
        assert size <= SETTINGS.strongest + 0.001
        assert size - last <= SETTINGS.strongest * 0.5 + 0.005, "a step is 0.1 s of 0.2 s at most"
        assert hand.kernel.felt(after=DESCRIPTION.hold) == Felt()
        last = size


def test_strength_and_direction_are_those_of_the_page() -> None:
    described = msgspec.structs.replace(
        DESCRIPTION, force_feeling=ForceFeeling(threshold_newtons=5, full_newtons=105, curve=1.0)
    )
    assert [contact_strength(force, described) for force in (0, 5, 55, 105, 500)] == [0, 0, 0.5, 1, 1]
    assert contact_strength(math.nan, described) == 0
    plain = msgspec.structs.replace(described, force_feeling=None)
    assert plain.wrench is not None
    assert contact_strength(plain.wrench.full_scale_force, plain) == 1
    blind = RobotDescription(name="blind", label="Blind", axes=DESCRIPTION.axes)
    assert contact_strength(99, blind) == 0
    assert stick_force(WALL, blind) == NO_FORCE
    assert stick_force([], described) == stick_force([math.nan, 0, 0], described) == NO_FORCE
    assert stick_force([0.0, -55.0, 0.0], described) == (0.5, 0)
    assert StickForce(0, -1).source_degrees == 0
    assert StickForce(-1, 0).source_degrees == 90
    assert ramped(NO_FORCE, StickForce(0, -1), 0.1, 0.5) == (0, -0.1)
    assert ramped(StickForce(0, -1), NO_FORCE, 0.1, 0.5) == (0, -0.5)
