"""What the settings limit: the rate of pictures, the codecs of sound."""

from tests.server.media.feeding import timestamps, value
from tests.server.media.viewer import noise, running_plane, viewing


async def test_sound_is_answered_with_the_codecs_that_the_settings_allow() -> None:
    async with (
        running_plane(sound_codecs=("PCMU",)) as hub,
        viewing(hub, ["audio"], codecs=("opus", "PCMU")) as viewer,
    ):
        assert [info.codec for info in viewer.media.streams] == ["PCMU"]


async def test_pictures_beyond_the_rate_are_left_out_and_counted() -> None:
    async with running_plane(video_frames_per_second=10) as hub, viewing(hub, ["video"]) as viewer:
        before = timestamps(viewer, "video")
        for number in range(1, 10):
            hub.feed(noise(number, number / 50), number / 50)
        await viewer.until(lambda: timestamps(viewer, "video") > before)
        assert value(hub, "frames_dropped_total", stream="camera0", stage="thinned") == 7
