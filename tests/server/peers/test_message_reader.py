"""Which messages are read, and when too many were bad."""

import pytest

from lockstep.protocol.messages import Ping, Stop
from lockstep.server.errors import Flood, MalformedMessage
from lockstep.server.peers.message_reader import FORGIVEN_RATE, MessageReader

PING, STOP = '{"type":"ping","id":1}', '{"type":"stop","by":"","reason":"dog"}'


def test_messages_within_the_rate_are_read_and_further_ones_are_a_flood() -> None:
    reader = MessageReader(2.0, 10)
    assert [reader.read("control", PING, 1.0) for _ in range(2)] == [Ping(id=1)] * 2
    with pytest.raises(Flood):
        reader.read("control", PING, 1.0)
    assert reader.read("control", PING, 2.0) == Ping(id=1)
    assert not reader.has_given_up


def test_a_bad_message_costs_as_much_as_a_good_one() -> None:
    reader = MessageReader(1.0, 10)
    with pytest.raises(MalformedMessage):
        reader.read("control", "nonsense", 1.0)
    with pytest.raises(Flood):
        reader.read("control", "nonsense", 1.0)


def test_a_stop_is_read_beyond_the_rate_but_not_without_end() -> None:
    reader = MessageReader(1.0, 3)
    heard = [(reader.read("stop", STOP, 1.0), reader.has_given_up) for _ in range(5)]
    assert heard == [(Stop(reason="dog"), False)] * 4 + [(Stop(reason="dog"), True)]


def test_bad_messages_are_forgiven_at_a_rate() -> None:
    reader = MessageReader(100.0, 2)
    for number in range(50):
        reader.refuse(number / FORGIVEN_RATE)
    assert not reader.has_given_up
    for _ in range(2):
        reader.refuse(49 / FORGIVEN_RATE)
    assert reader.has_given_up
