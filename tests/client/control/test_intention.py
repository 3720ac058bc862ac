from lockstep.client.control.intention import Intention, Want
from lockstep.protocol.messages import Command


def test_a_command_carries_the_values_or_neutral_ones_without_a_speed() -> None:
    intention = Intention([0.0, None])
    assert intention.set([1.0, 2.0], 0.5) == 1
    intention.action = "a"
    assert intention.command(2, 1, 7, Want.VALUES) == Command(
        event=2, issue=1, nonce=7, values=[1.0, 2.0], speed=0.5, action="a"
    )
    neutral = intention.command(2, 1, 7, Want.NEUTRAL)
    assert neutral == Command(event=2, issue=1, nonce=7, values=[0.0, None], action="a")
    assert intention.moves_nothing(neutral)


def test_values_that_are_forgotten_are_neutral() -> None:
    intention = Intention([0.0])
    intention.set([1.0])
    assert (intention.is_neutral, intention.lets_go) == (False, False)
    intention.forget(Want.NOTHING)
    assert (intention.want, intention.is_neutral, intention.lets_go) == (Want.NOTHING, True, True)
    assert intention.set(None) == 2
    assert intention.is_neutral


def test_a_command_that_renews_an_action_does_not_let_go() -> None:
    intention = Intention([0.0])
    intention.set(None)
    intention.action = "a"
    assert not intention.lets_go
