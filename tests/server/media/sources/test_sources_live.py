"""Attached sources on a whole console."""

from pathlib import Path

import pytest

from lockstep.protocol.console import Sources, Welcome
from tests.server.media.sources.media_files import film, tone
from tests.server.rig import eventually, running_rig


async def test_attached_media_come_after_the_robots_and_their_state_is_told(tmp_path: Path) -> None:
    cameras = (f"front=file:{film(tmp_path / 'film.mp4')}", "gone=tcp://user:geheim@127.0.0.1:1")
    microphones = (f"room=file:{tone(tmp_path / 'tone.wav')}",)
    async with running_rig(cameras=cameras, microphones=microphones) as rig, rig.peer("observer", "session") as peer:
        offers = [(each["stream"], each["kind"]) for each in (await rig.session())["streams"]]
        # The robot has a camera of that name; it keeps it.
        assert offers == [
            *(("overview", "video"), ("front", "video"), ("microphone", "audio")),
            *(("front-2", "video"), ("gone", "video"), ("room", "audio")),
        ]
        assert isinstance(await peer.until(lambda each: isinstance(each, Welcome)), Welcome)

        def settled(each: object) -> bool:
            return isinstance(each, Sources) and [s.state for s in each.sources] == ["live", "reconnecting", "live"]

        told = await peer.until(settled)
        assert isinstance(told, Sources)
        assert [(each.stream, each.label, each.detail) for each in told.sources] == [
            ("front-2", "Front", ""),
            ("gone", "Gone", "connection refused"),
            ("room", "Room", ""),
        ]
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="front-2") > 3)
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="room") > 3)
        assert rig.count("lockstep_media_source_live", source="front") == 1
        assert rig.count("lockstep_media_source_failures_total", source="gone", reason="refused") >= 1
        text = (await rig.http.get("/metrics", headers=rig.token("observer"))).text
        assert "geheim" not in text + repr(rig.dependencies.settings)


def test_bad_sources_are_refused_at_the_start_without_a_word_of_their_password() -> None:
    from pydantic import ValidationError

    from lockstep.server.settings import Settings

    for given in ({"cameras": ("rtsp:geheim",)}, {"microphones": "x=v4l2:/dev/video0"}):
        with pytest.raises(ValidationError) as caught:
            Settings(**given)
        assert "geheim" not in caught.value.errors()[0]["msg"]
    settings = Settings(cameras="a=rtsp://u:geheim@h/ b=file:x", microphones="pulse:")  # type: ignore[arg-type]
    assert [spec.name for spec in settings.sources] == ["a", "b", "microphone1"]
    with pytest.raises(ValidationError, match="used twice"):
        Settings(cameras="a=file:x", microphones="a=file:x")  # type: ignore[arg-type]
