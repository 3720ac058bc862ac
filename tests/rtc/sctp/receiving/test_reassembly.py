"""Fragments of messages that the peer has given up wait for nobody."""

import pytest

from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sctp.receiving.reassembly import Reassembly
from lockstep.rtc.sctp.wire.chunks import BEGIN, END, UNORDERED, InterleavedData, Skip


def _fragment(number: int, flags: int, message: int = 0) -> InterleavedData:
    return InterleavedData(
        tsn=number, flags=flags, stream=3, sequence=message, fragment=number, protocol=53, payload=bytes(100)
    )


@pytest.mark.parametrize("flag", [0, UNORDERED], ids=["in order", "unordered"])
def test_a_fragment_that_comes_after_its_message_was_given_up_is_not_held(flag: int) -> None:
    reassembly = Reassembly(SctpSettings(), interleaving=True)
    reassembly.push(_fragment(0, BEGIN | flag), 0)
    assert reassembly.held > 0
    reassembly.forward(1, [Skip(3, 0, bool(flag))])
    assert reassembly.held == 0
    reassembly.push(_fragment(2, END | flag), 2)
    assert (reassembly.held, reassembly.delivered) == (0, [])
    reassembly.push(_fragment(0, BEGIN | flag, message=1), 3)
    reassembly.push(_fragment(1, END | flag, message=1), 4)
    assert reassembly.held == 0
    assert [len(message.payload) for message in reassembly.delivered] == [200]
