"""Sound of a microphone as Opus: whole packets, true stamps, gaps."""

import math
import struct

import av
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.sound_encoder import OpusEncoder
from lockstep.robot_bridge.errors import EncodingFailed
from lockstep.server.media.codecs.opus_packet import OpusDecoder, opus_samples
from lockstep.server.media.errors import PayloadError


def segment(number: int, *, rate: int = 48_000, channels: int = 1, seconds: float = 0.02, late: float = 0.0) -> Media:
    """A tone of 440 Hz; segment i has stamp i + 1."""
    count = round(rate * seconds)
    tone = [round(12_000 * math.sin(math.tau * 440 * (number * count + n) / rate)) for n in range(count)]
    samples = struct.pack(f"<{count * channels}h", *(value for value in tone for _ in range(channels)))
    return Media(
        stream="microphone",
        codec="pcm_s16le",
        stamp=number + 1,
        time=10 + number * seconds + late,
        payload=samples,
        sample_rate=rate,
        channels=channels,
    )


def encoded(*segments: Media) -> list[Media]:
    encoder = OpusEncoder()
    return [packet for each in segments for packet in encoder.encode(each)]


@pytest.mark.parametrize("rate", [48_000, 16_000, 44_100])
@pytest.mark.parametrize("channels", [1, 2])
def test_a_tone_comes_out_as_it_went_in(rate: int, channels: int) -> None:
    packets = encoded(*(segment(n, rate=rate, channels=channels) for n in range(50)))
    assert 48 <= len(packets) <= 50
    assert {each.codec for each in packets} == {"opus"}
    assert {(each.sample_rate, each.channels) for each in packets} == {(48_000, channels)}
    assert all(opus_samples(each.payload) == 960 for each in packets)
    assert sum(len(each.payload) for each in packets) < 8000
    decoder = OpusDecoder()
    sound = np.concatenate([decoder.decode(each.payload) for each in packets])[9600:40_000]
    spectrum = np.abs(np.fft.rfft(sound))
    assert abs(np.argmax(spectrum) * 48_000 / len(sound) - 440) < 5


def test_no_packet_is_stamped_newer_than_its_oldest_sound() -> None:
    """The sound of a packet begins 6.5 ms before its place, in the segment before."""
    packets = encoded(*(segment(n) for n in range(20)))
    assert [each.stamp for each in packets] == [1, *range(1, 20)]
    times = [each.time for each in packets]
    assert times == pytest.approx([10 + 0.02 * n for n in range(20)])


def test_segments_of_other_lengths_make_packets_of_20_ms() -> None:
    packets = encoded(*(segment(n, seconds=0.005) for n in range(80)))
    assert len(packets) == 20
    assert [each.time for each in packets] == pytest.approx([10 + 0.02 * n for n in range(20)])
    assert all(each.stamp <= round((each.time - 10) / 0.005) + 1 for each in packets)


def test_after_a_gap_sound_has_its_own_time_and_stamp_again() -> None:
    packets = encoded(segment(0), segment(1), segment(2, late=1.0), segment(3, late=1.0))
    assert [each.time for each in packets] == pytest.approx([10.0, 10.02, 11.04, 11.06])
    assert packets[2].stamp == 3


def test_after_a_gap_nothing_of_the_sound_before_it_is_heard() -> None:
    """The encoder looks 6.5 ms ahead: it would begin the next run with what it has kept of the last."""
    silence = msgspec.structs.replace(segment(25, late=10.0), payload=bytes(1920))
    packets = encoded(*(segment(n) for n in range(25)), silence)
    decoder = OpusDecoder()
    before = [decoder.decode(each.payload) for each in packets[:-1]]
    assert np.abs(before[-1]).max() > 6000
    assert np.abs(OpusDecoder().decode(packets[-1].payload)).max() < 100


@pytest.mark.parametrize(
    "medium",
    [
        Media(stream="m", codec="pcm_s16le", stamp=1, time=0.0, payload=b"", sample_rate=48_000, channels=1),
        Media(stream="m", codec="pcm_s16le", stamp=1, time=0.0, payload=b"abc", sample_rate=48_000, channels=1),
        Media(stream="m", codec="pcm_s16le", stamp=1, time=0.0, payload=b"abcd", sample_rate=0, channels=1),
        Media(stream="m", codec="pcm_s16le", stamp=1, time=0.0, payload=b"abcd", sample_rate=48_000, channels=3),
    ],
)
def test_what_is_no_sound_is_named_and_what_follows_is_encoded(medium: Media) -> None:
    encoder = OpusEncoder()
    with pytest.raises(EncodingFailed):
        encoder.encode(medium)
    assert [packet.stamp for n in range(3) for packet in encoder.encode(segment(n))] == [1, 1, 2]


def test_the_tests_read_opus_as_ffmpeg_does() -> None:
    """A packet of every duration that libopus makes is measured right."""
    for milliseconds in ("2.5", "5", "10", "20", "40", "60"):
        context = av.CodecContext.create("libopus", "w")
        assert isinstance(context, av.AudioCodecContext)
        context.format, context.layout, context.sample_rate = "s16", "mono", 48_000
        context.options = {"frame_duration": milliseconds, "application": "audio"}
        count = int(48 * float(milliseconds))
        frame = av.AudioFrame.from_ndarray(np.zeros((1, count), np.int16), "s16", "mono")
        frame.sample_rate = 48_000
        (packet,) = context.encode(frame)
        assert opus_samples(bytes(packet)) == count


@pytest.mark.parametrize("packet", [b"", b"\x03", b"\x03\x00", b"\xff\x3f", bytes(1276)])
def test_what_is_no_opus_packet_is_named(packet: bytes) -> None:
    with pytest.raises(PayloadError):
        opus_samples(packet)


@given(st.binary(max_size=1400))
def test_no_bytes_of_a_robot_raise_anything_but_a_named_error(packet: bytes) -> None:
    try:
        samples = opus_samples(packet)
    except PayloadError:
        return
    assert 0 < samples <= 5760
