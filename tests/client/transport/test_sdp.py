from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.transport.sdp import read_sections, replace_candidates


def test_an_answer_is_read() -> None:
    sdp = "\r\n".join(
        [
            "v=0",
            "m=video 9 UDP/TLS/RTP/SAVPF 97 98",
            "a=sendonly",
            "a=extmap:4/sendonly urn:x",
            "a=mid:0",
            "a=msid:front 77",
            "a=rtpmap:97 VP8/90000",
            "a=ssrc:11 cname:a",
            "a=ssrc:11 msid:front",
            "a=ssrc:12 cname:a",
            "m=audio 0 UDP/TLS/RTP/SAVPF 0",
            "a=inactive",
            "a=mid:1",
            "",
        ]
    )
    video, audio = read_sections(sdp)
    assert (video.mid, video.stream, video.receives) == ("0", "front", True)
    assert (video.codecs, video.extensions, video.ssrcs) == ({97: "VP8"}, {"urn:x": 4}, [11, 12])
    assert (audio.kind, audio.mid, audio.receives) == ("audio", "1", False)


def test_each_section_gets_the_relay_as_its_only_candidate() -> None:
    sdp = (
        "m=audio 1 X\r\na=candidate:1 1 udp 5 10.0.0.1 4000 typ host\r\n"
        "a=candidate:2 1 udp 4 10.0.0.2 4000 typ host\r\n"
        "a=end-of-candidates\r\nm=video 1 X\r\na=candidate:1 1 UDP 5 10.0.0.1 4000 typ host\r\n"
    )
    lines = replace_candidates(sdp, "127.0.0.1", 5).splitlines()
    assert lines.count("a=candidate:1 1 udp 5 127.0.0.1 5 typ host") == 2
    assert sum(line.startswith("a=candidate:") for line in lines) == 2
    assert "a=end-of-candidates" in lines


@given(
    st.lists(st.sampled_from(["m=audio", "m=", "a=mid:", "a=msid:", "a=rtpmap:1 ", "a=extmap:", "a=ssrc:"]) | st.text())
)
def test_no_text_raises(lines: list[str]) -> None:
    text = "\r\n".join(lines)
    read_sections(text)
    replace_candidates(text, "127.0.0.1", 1)
