"""Opus that a robot has encoded, on its way to peers of either codec."""

import pytest

from lockstep.protocol.description import Microphone
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.sound_encoder import OpusEncoder
from lockstep.server.media.encoding.opus_passing import OpusPassing
from lockstep.server.media.errors import PayloadError
from tests.robot_bridge.encoding.test_sound_encoder import segment
from tests.server.media.feeding import value
from tests.server.media.viewer import description, running_plane, viewing


def packets(count: int) -> list[Media]:
    encoder = OpusEncoder()
    return [each for number in range(count) for each in encoder.encode(segment(number))]


def test_packets_follow_each_other_and_a_gap_moves_the_time_line_on() -> None:
    passing, made = OpusPassing(), packets(6)
    del made[3:5]  # 40 ms count as the clock's jitter, more do not
    found = [passing.take(each, 100.0 + each.time).packet for each in made]
    assert [each.media_time for each in found] == [0, 960, 1920, 2880]
    later = packets(20)[19]
    assert passing.take(later, 0.0).packet.media_time == 19 * 960
    assert passing.take(later, 0.0).packet.talkspurt is False
    assert [each.talkspurt for each in found] == [True, False, False, False]
    assert [each.data for each in found] == [each.payload for each in made]


def test_what_is_no_opus_is_named_and_the_next_packet_is_decoded() -> None:
    passing = OpusPassing()
    broken = Media(stream="m", codec="opus", stamp=1, time=0.0, payload=b"", sample_rate=48_000, channels=1)
    with pytest.raises(PayloadError):
        passing.take(broken, 0.0)
    sound = passing.decoded(passing.take(packets(2)[1], 0.0))
    assert (sound.sample_rate, sound.channels) == (48_000, 1)
    assert len(sound.samples) > 500


@pytest.mark.parametrize("payload", [b"", bytes(2000), b"\x03", b"\xff\xff\xff"])
async def test_a_robots_broken_packets_are_counted_and_the_sound_goes_on(payload: bytes) -> None:
    robot = description()
    name = robot.microphones[0].name
    assert isinstance(robot.microphones[0], Microphone)
    async with running_plane(robot) as hub, viewing(hub, ["audio"]) as viewer:
        hub.feed(Media(stream=name, codec="opus", stamp=1, time=9.98, payload=payload), 0.0)
        for number, packet in enumerate(packets(5)):
            hub.feed(Media(**{**_fields(packet), "stream": name}), 0.02 * number)  # type: ignore[arg-type]
        await viewer.until(lambda: len(viewer.of("audio")) >= 5)
        assert value(hub, "frames_dropped_total", stream=name, stage="bad_payload") == 1


def _fields(medium: Media) -> dict[str, object]:
    return {name: getattr(medium, name) for name in medium.__struct_fields__}
