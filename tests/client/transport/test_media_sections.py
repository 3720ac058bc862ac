import pytest

from lockstep.client.transport.media_sections import receiving
from lockstep.rtc.sdp import MID_URI


def test_a_section_has_every_codec_with_its_retransmissions() -> None:
    media = receiving("video", extension="urn:stamp")
    assert media.direction == "recvonly"
    assert media.extensions == (MID_URI, "urn:stamp")
    assert [each.name for each in media.codecs] == ["VP8", "rtx", "H264", "rtx", "H264", "rtx"]
    assert [each.name for each in receiving("audio").codecs] == ["opus", "PCMU"]


def test_a_codec_that_is_chosen_is_alone_with_its_retransmissions() -> None:
    media = receiving("video", "H264")
    assert {each.name for each in media.codecs} == {"H264", "rtx"}
    numbers = {each.payload_type for each in media.codecs if each.repairs is None}
    assert {each.repairs for each in media.codecs if each.repairs is not None} == numbers
    assert [each.name for each in receiving("audio", "PCMU").codecs] == ["PCMU"]
    assert receiving("video").extensions == (MID_URI,)


def test_a_codec_that_is_not_there_is_said() -> None:
    with pytest.raises(ValueError, match="no codec AV1; there are VP8 and H264"):
        receiving("video", "AV1")
