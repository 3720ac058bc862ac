"""What a Janus says, read; and what it leaves out of its descriptions."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.errors import MessageError
from lockstep.protocol.janus import Heard, complete_description, janus_request, parse_janus


def test_a_request_leaves_out_what_is_not_known_yet() -> None:
    assert json.loads(janus_request("create", "a-1", session_id=None)) == {"janus": "create", "transaction": "a-1"}


def test_an_event_of_the_plugin_carries_its_data_and_its_description() -> None:
    text = json.dumps(
        {
            "janus": "event",
            "sender": 7,
            "transaction": "t",
            "plugindata": {"plugin": "janus.plugin.videoroom", "data": {"videoroom": "attached"}},
            "jsep": {"type": "offer", "sdp": "v=0"},
        }
    )
    heard = parse_janus(text)
    assert (heard.kind, heard.handle, heard.transaction) == ("event", 7, "t")
    assert heard.data == {"videoroom": "attached"}
    assert heard.jsep == {"type": "offer", "sdp": "v=0"}


@pytest.mark.parametrize(
    "message",
    [
        {"janus": "error", "transaction": "t", "error": {"code": 458, "reason": "No such session"}},
        {
            "janus": "event",
            "transaction": "t",
            "plugindata": {"data": {"error_code": 458, "error": "No such session"}},
        },
    ],
)
def test_errors_of_the_core_and_of_the_plugin_are_one_kind(message: dict[str, object]) -> None:
    heard = parse_janus(json.dumps(message))
    assert (heard.kind, heard.code, heard.detail) == ("error", 458, "No such session")


@pytest.mark.parametrize("said", ["hangup", "detached", "timeout"])
def test_a_handle_that_ended_says_why(said: str) -> None:
    heard = parse_janus(json.dumps({"janus": said, "sender": 3, "reason": "ICE failed"}))
    assert (heard.kind, heard.handle, heard.detail) == ("ended", 3, "ICE failed")


@pytest.mark.parametrize("text", ["", "{", "[]", "7", "{}", '{"janus": 1}', b"\xff"])
def test_what_is_no_message_is_a_named_error(text: str | bytes) -> None:
    with pytest.raises(MessageError):
        parse_janus(text)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
KEYS = st.sampled_from(["sender", "transaction", "plugindata", "data", "jsep", "error", "reason"])


@given(st.dictionaries(KEYS, JSON), st.sampled_from(["event", "success", "error", "hangup", "ack", "webrtcup"]))
def test_whatever_the_fields_hold_a_message_is_read_or_refused(fields: dict[str, object], said: str) -> None:
    assert isinstance(parse_janus(json.dumps({**fields, "janus": said})), Heard)


def test_the_size_of_messages_and_the_format_of_h264_are_added_where_they_are_missing() -> None:
    sdp = "m=video 9 UDP 96\r\na=rtpmap:96 H264/90000\r\nm=application 9 UDP webrtc-datachannel\r\na=sctp-port:5000\r\n"
    lines = complete_description(sdp).splitlines()
    assert lines[2] == "a=fmtp:96 profile-level-id=42e01f;packetization-mode=1"
    assert lines[-1] == "a=max-message-size:65536"


def test_what_a_description_says_already_is_left_alone() -> None:
    sdp = (
        "m=video 9 UDP 96\r\na=rtpmap:96 H264/90000\r\na=fmtp:96 profile-level-id=42001f\r\n"
        "m=application 9 UDP webrtc-datachannel\r\na=sctp-port:5000\r\na=max-message-size:100\r\n"
    )
    assert complete_description(sdp) == sdp
