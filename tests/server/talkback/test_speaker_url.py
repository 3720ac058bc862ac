import pytest

from lockstep.server.talkback.speaker_url import BadSpeaker, SpeakerSpec, parse_speaker


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("pulse:", SpeakerSpec("pulse", "")),
        ("pulse:ears", SpeakerSpec("pulse", "ears")),
        ("alsa:", SpeakerSpec("alsa", "default")),
        ("alsa:hw:1,0", SpeakerSpec("alsa", "hw:1,0")),
        ("file:/a/b%20c.wav", SpeakerSpec("file", "/a/b c.wav")),
    ],
)
def test_an_output_is_read(text: str, spec: SpeakerSpec) -> None:
    assert parse_speaker(text) == spec


@pytest.mark.parametrize("text", ["", "pulse", "file:", "rtsp://host/"])
def test_what_is_none_is_refused(text: str) -> None:
    with pytest.raises(BadSpeaker):
        parse_speaker(text)
