"""Hypothesis strategies for messages of the robot link."""

import msgspec
from hypothesis import strategies as st

from lockstep.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    Media,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    Stop,
)
from lockstep.protocol.serial import FIRST_EVENT, MAX_EVENT

__all__ = ["events", "link_messages", "mutated"]

events = st.integers(FIRST_EVENT, MAX_EVENT)
texts = st.text(max_size=20)
numbers = st.floats(allow_nan=False)
issues = st.integers(1, 2**40)

link_messages: st.SearchStrategy[LinkMessage] = st.one_of(
    st.builds(Hello, role=st.sampled_from(["robot", "operator", "events", "media"]), name=texts, epoch=texts),
    st.builds(Command, event=events, issue=issues, values=st.lists(numbers, max_size=8)),
    st.builds(
        Feedback,
        event=events,
        issue=issues,
        time=numbers,
        axes=st.lists(numbers, max_size=4),
        joints=st.lists(numbers, max_size=4),
        at_rest=st.booleans(),
        faults=st.lists(texts, max_size=2),
    ),
    st.builds(Refusal, event=st.just(0) | events, reason=st.sampled_from(["late", "stopped"]), current=events),
    st.builds(EventNotice, event=events, time=numbers),
    st.builds(
        Media,
        stream=texts,
        codec=st.sampled_from(["yuv420p", "pcm_s16le"]),
        stamp=events,
        time=numbers,
        payload=st.binary(max_size=64),
    ),
    st.builds(Rest, event=events),
    st.builds(Stop, by=texts, reason=texts),
    st.builds(Reset, by=texts),
    st.builds(Ping, id=st.integers(-(2**31), 2**31)),
    st.builds(Pong, id=st.integers(0, 2**31)),
    st.builds(Goodbye, error=texts, detail=texts),
)


@st.composite
def mutated(draw: st.DrawFn, valid: st.SearchStrategy[bytes]) -> bytes:
    """Valid bytes with a few of them changed, cut, or added."""
    data = bytearray(draw(valid))
    for _ in range(draw(st.integers(1, 4))):
        position = draw(st.integers(0, len(data)))
        match draw(st.sampled_from(["change", "cut", "add"])):
            case "change" if position < len(data):
                data[position] = draw(st.integers(0, 255))
            case "cut":
                del data[position : position + draw(st.integers(1, 4))]
            case _:
                data[position:position] = draw(st.binary(min_size=1, max_size=4))
    return bytes(data)


def as_map(message: LinkMessage) -> dict[str, object]:
    """The message as the map that goes over the wire."""
    decoded: dict[str, object] = msgspec.msgpack.decode(msgspec.msgpack.encode(message))
    return decoded
