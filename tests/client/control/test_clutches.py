from lockstep.client.control.clutch import Clutch
from lockstep.client.control.clutches import Clutches
from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Rest
from tests.makers import refusal

ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(Axis(name="j", label="J", unit="rad", minimum=-9, maximum=9, slew=1, brake=4, kind="goal", reach=0.5),),
)
AGE = 2.0  # s


def measured(event: int, goal: float = 1.0, *, at_rest: bool = False) -> Feedback:
    return Feedback(event=event, issue=1, time=0.0, axes=[goal], goals=[goal], at_rest=at_rest)


class Side:
    """An operator's side that may move the robot, with feedback 1 at hand."""

    def __init__(self) -> None:
        self.sender = CommandSender(CommandGate("feedback", 4, 0.0), [None])
        self.clutches = Clutches(self.sender, AGE)
        self.clutch = Clutch(ARM, {"j": 1.0})
        self.hear(measured(1, at_rest=True), 0.0)
        self.sender.readiness.ready = True
        self.clutches.add(self.clutch, 0.0)

    def hear(self, feedback: Feedback, now: float) -> None:
        if self.sender.feedback(feedback, now):
            self.clutches.feedback(feedback, now)
        self.clutches.settle()

    def drive(self, device: float, now: float) -> list[Command | Rest]:
        self.sender.intend(self.clutch.goals([device]), now)
        return self.leave(now)

    def leave(self, now: float) -> list[Command | Rest]:
        messages = self.sender.due(now)
        for message in messages:
            self.clutches.sent(message)
        self.clutches.settle()
        return messages


def test_a_new_clutch_knows_the_newest_feedback_unless_it_is_old() -> None:
    side = Side()
    late, fresh = Clutch(ARM, {"j": 1.0}), Clutch(ARM, {"j": 1.0})
    side.clutches.add(fresh, AGE)
    side.clutches.add(late, AGE + 0.1)
    assert fresh.engage([0.0])
    assert not late.engage([0.0])


def test_it_stays_engaged_from_command_to_command() -> None:
    side = Side()
    assert side.clutch.engage([0.0])
    for event in range(2, 20):
        [command] = side.drive(0.01 * event, 0.05 * event)
        assert isinstance(command, Command)
        assert command.values == [1.0 + 0.01 * event]
        side.hear(measured(event), 0.05 * event + 0.01)
    assert side.clutch.engaged


def test_the_neutral_command_that_leaves_when_nobody_drives_releases_it() -> None:
    side = Side()
    side.clutch.engage([0.0])
    side.drive(0.0, 0.0)
    side.hear(measured(2), 0.05)
    assert [message.values for message in side.leave(0.5) if isinstance(message, Command)] == [[None]]
    assert not side.clutch.engaged


def test_a_refusal_that_is_not_cured_by_trying_again_releases_it_and_a_late_one_does_not() -> None:
    side = Side()
    side.clutch.engage([0.0])
    side.drive(0.0, 0.0)
    side.sender.refusal(refusal(2, "late"))
    side.clutches.settle()
    assert side.clutch.engaged
    side.hear(Feedback(event=1, issue=2, time=0.0, axes=[1.0], goals=[1.0]), 0.1)
    side.leave(0.1)
    side.sender.refusal(refusal(2, "jump"))
    side.clutches.settle()
    assert not side.clutch.engaged


def test_after_a_gap_of_feedback_the_goal_that_waits_is_void_and_a_rest_leaves() -> None:
    side = Side()
    side.clutch.engage([0.0])
    side.drive(0.0, 0.0)
    side.hear(measured(2), 0.05)
    side.drive(0.1, 0.1)
    side.sender.intend(side.clutch.goals([0.4]), 0.2)  # it waits for the answer
    side.hear(measured(3, 0.5, at_rest=True), 3.0)
    assert not side.clutch.engaged
    messages = side.leave(3.0)
    assert any(isinstance(message, Rest) for message in messages)
    assert all(message.values == [None] for message in messages if isinstance(message, Command))
    [outcome] = [each for each in side.sender.outcomes() if each.refusal is not None]
    assert outcome.refusal is not None
    assert outcome.refusal.reason == "rested"
    assert side.clutch.engage([7.0])  # by the feedback after the gap
    assert side.clutch.goals([7.0]) == [0.5]


def test_a_lost_seat_releases_it() -> None:
    side = Side()
    side.clutch.engage([0.0])
    side.sender.seat_changed(False)
    side.clutches.settle()
    assert not side.clutch.engaged
