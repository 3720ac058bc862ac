"""When a robot is asked for a keyframe, and when it counts as one that makes none."""

from lockstep.server.media.encoding.robot_keyframes import ANSWER_SECONDS, DISTRUST_SECONDS, RobotKeyframes
from tests.server.media.pipeline.collecting import Counted


def test_a_robot_that_follows_is_asked_once_for_those_who_wait() -> None:
    counted, asked = Counted(), list[float]()
    encodings = counted.encodings("H264")
    keyframes = RobotKeyframes(encodings, encodings.add_passed())
    keyframes.ask_by(asked.append)
    encodings.join("H264", counted.subscription())
    keyframes.follow(True, 0.0)
    keyframes.serve(0.0)
    assert (encodings.follows, asked) == (False, []), "it gives no H.264 yet"
    encodings.passes = True
    keyframes.came(0.1)
    assert encodings.follows
    for now in (0.5, 0.6, 0.7):
        keyframes.serve(now)
    assert asked == [0.5], "one is on its way"
    keyframes.came(1.0)
    keyframes.serve(1.1)
    assert asked == [0.5], "nobody new waits"
    encodings.join("H264", counted.subscription())
    keyframes.serve(1.2)
    assert asked == [0.5, 1.2]


def test_a_robot_that_does_not_answer_counts_for_a_while_as_one_that_does_not_follow() -> None:
    counted, asked = Counted(), list[float]()
    encodings = counted.encodings("H264")
    keyframes = RobotKeyframes(encodings, encodings.add_passed())
    keyframes.ask_by(asked.append)
    encodings.passes = True
    keyframes.follow(True, 0.0)
    encodings.join("H264", counted.subscription())
    follows = []
    late = ANSWER_SECONDS + 0.1
    for now in (0.0, ANSWER_SECONDS, late):
        keyframes.serve(now)
        follows.append(encodings.follows)
    for now in (late + DISTRUST_SECONDS - 0.1, late + DISTRUST_SECONDS):
        keyframes.follow(True, now)
        follows.append(encodings.follows)
    assert (follows, asked) == ([True, True, False, False, True], [0.0])
