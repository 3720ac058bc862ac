import pytest

from lockstep.server.media.sources.source_url import BadSource, SourceSpec, parse_source, parse_sources


def test_a_source_without_options_gets_a_name_and_the_latency_of_its_kind() -> None:
    spec = parse_source("video", "rtsp://10.0.0.7:554/main?channel=1", 2)
    assert (spec.name, spec.label, spec.scheme) == ("camera2", "Camera 2", "rtsp")
    assert spec.address == "rtsp://10.0.0.7:554/main?channel=1"
    assert (spec.latency, spec.rate, spec.size, spec.transport) == (0.3, None, None, "tcp")


def test_name_and_options_stand_before_and_behind() -> None:
    text = "front=rtsp://user:p%23w@host/x#latency=0.25,size=640x480,rate=15,transport=udp,pass=off,label=Front%20door"
    spec = parse_source("video", text)
    assert (spec.name, spec.label, spec.address) == ("front", "Front door", "rtsp://user:p%23w@host/x")
    assert (spec.latency, spec.size, spec.rate, spec.transport, spec.passing) == (0.25, (640, 480), 15, "udp", False)


@pytest.mark.parametrize(
    ("kind", "text", "address"),
    [
        ("video", "v4l2:/dev/video0", "/dev/video0"),
        ("video", "file:/a/b%23c.mp4", "/a/b#c.mp4"),
        ("video", "udp://127.0.0.1:5000?fifo_size=1", "udp://127.0.0.1:5000?fifo_size=1"),
        ("audio", "alsa:hw:1,0", "hw:1,0"),
        ("audio", "pulse:", ""),
        ("audio", "room=pulse:ears.monitor", "ears.monitor"),
    ],
)
def test_every_scheme_says_what_is_opened(kind: str, text: str, address: str) -> None:
    assert parse_source("video" if kind == "video" else "audio", text).address == address


@pytest.mark.parametrize(
    "text",
    [
        *("", "front", "front=", "/dev/video0", "rtsp:", "rtsp:host", "alsa:hw:1", "pulse:", "v4l2:"),
        *("file:x#latency", "file:x#latency=-1", "file:x#latency=nan", "file:x#size=640", "file:x#size=641x480"),
        *("file:x#rate=0", "file:x#channels=1", "file:x#transport=udp", "file:x#format=h264", "rtsp://x#pass=maybe"),
        *("rtsp://x#transport=smoke", "1x=notascheme"),
    ],
)
def test_what_cannot_be_meant_is_refused(text: str) -> None:
    with pytest.raises(BadSource):
        parse_source("video", text)


def test_neither_a_refusal_nor_a_description_repeats_a_password() -> None:
    for text in ("rtsp:user:geheim@host", "rtsp://user:geheim@host#bad=1", "a=b=rtsp:geheim"):
        with pytest.raises(BadSource) as caught:
            parse_sources("video", [text])
        assert "geheim" not in str(caught.value)
    assert "geheim" not in repr(parse_source("video", "rtsp://user:geheim@host/"))


def test_names_are_unique_and_sources_are_few() -> None:
    with pytest.raises(BadSource, match="number 2"):
        parse_sources("video", ["a=file:x", "a=file:y"])
    with pytest.raises(BadSource, match="more than"):
        parse_sources("video", ["file:x"] * 9)
    found: tuple[SourceSpec, ...] = parse_sources("audio", ["file:x", "file:y"])
    assert [spec.name for spec in found] == ["microphone1", "microphone2"]
