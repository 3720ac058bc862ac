from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NoReturn

import av
import numpy as np
import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.event_strip import read_event_strip, with_event_strip
from lockstep.server.media.codecs.packetise import split_nal_units
from lockstep.server.media.codecs.picture import PictureDecoder
from lockstep.server.media.codecs.picture_encoder import (
    VIDEO_CODECS,
    EncodedPicture,
    PictureEncoder,
    create_picture_encoder,
)
from lockstep.server.media.codecs.sound_encoder import (
    AUDIO_CODECS,
    EncodedSound,
    Segment,
    SoundEncoder,
    create_sound_encoder,
)
from lockstep.server.media.errors import EncodeError, PayloadError, UnsupportedCodecError
from tests.server.media.viewer import HEIGHT, WIDTH, noise, picture, sound

DECODERS = {"H264": "h264", "VP8": "libvpx", "opus": "libopus", "PCMU": "pcm_mulaw"}


def jpeg(shade: int) -> bytes:
    context = av.CodecContext.create("mjpeg", "w")
    context.width, context.height, context.pix_fmt = WIDTH, HEIGHT, "yuvj420p"
    context.time_base = Fraction(1, 30)
    frame = av.VideoFrame.from_ndarray(np.full((HEIGHT * 3 // 2, WIDTH), shade, np.uint8), format="yuvj420p")
    frame.pts = 0
    packets = [*context.encode(frame), *context.encode(None)]
    return b"".join(map(bytes, packets))


def video_encoder(codec: str) -> PictureEncoder:
    return create_picture_encoder(codec, 800_000, 30.0)


def encode(encoder: PictureEncoder, media: Sequence[Media], keys: Sequence[int] = ()) -> list[EncodedPicture]:
    decoder = PictureDecoder()
    return [encoder.encode(decoder.decode(medium), i * 3000, i in keys) for i, medium in enumerate(media)]


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_one_picture_in_is_one_picture_out_and_can_be_decoded(codec: str) -> None:
    decoder: Any = av.CodecContext.create(DECODERS[codec], "r")
    shades = [30, 60, 90, 120]
    encoded = encode(video_encoder(codec), [picture(shade - 20, 0.0) for shade in shades])
    packets = [av.Packet(item.data) for item in encoded]
    frames = [frame for packet in [*packets, None] for frame in decoder.decode(packet)]
    assert [int(frame.to_ndarray()[60, 80]) for frame in frames] == pytest.approx(shades, abs=12)


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_keyframes_come_when_asked_for_and_only_then(codec: str) -> None:
    encoded = encode(video_encoder(codec), [noise(i + 1, 0.0) for i in range(12)], keys=(0, 5, 6))
    assert [i for i, item in enumerate(encoded) if item.keyframe] == [0, 5, 6]


def test_h264_is_constrained_baseline_in_one_slice_with_parameter_sets_on_every_keyframe() -> None:
    encoded = encode(video_encoder("H264"), [noise(i + 1, 0.0) for i in range(4)], keys=(0, 2))
    for item in encoded:
        kinds = [nal[0] & 0x1F for nal in split_nal_units(item.data) if nal[0] & 0x1F != 6]
        assert kinds == ([7, 8, 5] if item.keyframe else [1])
    parameters = next(nal for nal in split_nal_units(encoded[2].data) if nal[0] & 0x1F == 7)
    assert parameters[1] == 66  # baseline
    assert parameters[2] & 0x40  # constraint_set1: constrained


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_a_new_size_starts_with_a_keyframe(codec: str) -> None:
    small = picture(1, 0.0, width=64, height=48, payload=bytes(64 * 48 * 3 // 2))
    encoded = encode(video_encoder(codec), [picture(1, 0.0), picture(2, 0.0), small])
    assert [item.keyframe for item in encoded] == [True, False, True]


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_an_encoder_that_failed_starts_afresh(codec: str, monkeypatch: pytest.MonkeyPatch) -> None:
    encoder = video_encoder(codec)
    encode(encoder, [picture(1, 0.0)])
    with monkeypatch.context() as patch:
        patch.setattr(type(encoder), "_open", refuse)
        with pytest.raises(EncodeError):
            encode(encoder, [picture(1, 0.0, width=64, height=48, payload=bytes(64 * 48 * 3 // 2))])
    assert encode(encoder, [picture(1, 0.0)])[0].keyframe


def refuse(encoder: PictureEncoder) -> NoReturn:
    raise ValueError("no more contexts")


def test_jpeg_pictures_become_yuv420p_in_video_range() -> None:
    media = picture(1, 0.0, codec="mjpeg", payload=jpeg(128))
    frame = PictureDecoder().decode(media)
    assert (frame.format.name, frame.width, frame.height) == ("yuv420p", WIDTH, HEIGHT)
    assert abs(int(frame.to_ndarray()[60, 80]) - (16 + 128 * 219 // 255)) <= 2


@pytest.mark.parametrize(
    "changes",
    [
        {"payload": b""},
        {"width": 0, "payload": b""},
        {"width": 161, "payload": bytes(161 * 120 * 3 // 2)},
        {"height": 8, "payload": bytes(160 * 12)},
        {"codec": "mjpeg", "payload": b""},
        {"codec": "mjpeg", "payload": b"\xff\xd8\xff\xd9"},
        {"codec": "mjpeg", "payload": bytes(100)},
    ],
)
def test_what_is_no_picture_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(PayloadError):
        PictureDecoder().decode(picture(1, 0.0, **changes))


def test_unknown_codecs_are_refused() -> None:
    with pytest.raises(UnsupportedCodecError):
        PictureDecoder().decode(picture(1, 0.0, codec="pcm_s16le"))
    with pytest.raises(UnsupportedCodecError):
        create_picture_encoder("AV1", 1, 30.0)
    with pytest.raises(UnsupportedCodecError):
        create_sound_encoder("G722", 1, 0)


def sound_encoder(codec: str) -> SoundEncoder:
    return create_sound_encoder(codec, 32_000, 10)


def tone(start: int, count: int, rate: int, channels: int = 1) -> Any:
    samples = (np.sin(np.arange(start, start + count) * 440 * 2 * np.pi / rate) * 8000).astype(np.int16)
    return np.repeat(samples, channels)


def segments(rate: int, sizes: Sequence[int], channels: int = 1, start: float = 5.0) -> list[Segment]:
    """Segment i (from 1) has stamp i; they follow each other without a gap."""
    result, first = [], 0
    for i, size in enumerate(sizes, 1):
        at = start + first / rate
        result.append(Segment(tone(first, size, rate, channels), rate, channels, i, at, 1000 + at))
        first += size
    return result


def run(encoder: SoundEncoder, parts: Sequence[Segment]) -> list[EncodedSound]:
    return [packet for part in parts for packet in encoder.encode(part)]


@pytest.mark.parametrize("codec", AUDIO_CODECS)
@pytest.mark.parametrize("rate", [8_000, 16_000, 44_100, 48_000])
@pytest.mark.parametrize("channels", [1, 2])
def test_segments_of_any_length_become_packets_of_20_ms(codec: str, rate: int, channels: int) -> None:
    encoder = sound_encoder(codec)
    packets = run(encoder, segments(rate, [rate // 100, rate // 30, rate // 50] * 8, channels))
    step = encoder.rate // 50
    assert [packet.media_time for packet in packets] == [i * step for i in range(len(packets))]
    assert 23 <= len(packets) <= 25
    assert [packet.talkspurt for packet in packets] == [True] + [False] * (len(packets) - 1)
    for i, packet in enumerate(packets):
        assert packet.capture_time == pytest.approx(1005 + i * 0.02, abs=1e-3)


@pytest.mark.parametrize("codec", AUDIO_CODECS)
def test_the_tone_is_heard(codec: str) -> None:
    decoder: Any = av.CodecContext.create(DECODERS[codec], "r")
    decoder.sample_rate, decoder.layout, decoder.format = sound_encoder(codec).rate, "mono", "s16"
    heard = []
    for packet in run(sound_encoder(codec), segments(16_000, [320] * 30)):
        heard += [frame.to_ndarray().reshape(-1) for frame in decoder.decode(av.Packet(packet.data))]
    samples = np.concatenate(heard)[-sound_encoder(codec).rate // 4 :].astype(float)
    spectrum = np.abs(np.fft.rfft(samples))
    assert np.argmax(spectrum) * 4 == pytest.approx(440, abs=4)


@pytest.mark.parametrize("codec", AUDIO_CODECS)
@pytest.mark.parametrize("rate", [8_000, 16_000, 48_000])
def test_a_packet_is_never_stamped_newer_than_the_oldest_sound_in_it(codec: str, rate: int) -> None:
    encoder = sound_encoder(codec)
    size = rate // 100  # 10 ms: two stamps in every packet
    for packet in run(encoder, segments(rate, [size] * 60)):
        oldest = max(0.0, (packet.media_time - encoder.look_ahead) / encoder.rate)
        assert packet.stamp == int(oldest / 0.01 + 1e-9) + 1


@pytest.mark.parametrize("codec", AUDIO_CODECS)
def test_missing_sound_moves_the_media_time_on_and_begins_a_talkspurt(codec: str) -> None:
    encoder = sound_encoder(codec)
    run(encoder, segments(16_000, [320] * 5))
    packets = run(encoder, segments(16_000, [320] * 5, start=6.0))
    assert packets[0].media_time == encoder.rate
    assert packets[0].talkspurt
    assert packets[0].stamp == 1
    assert packets[0].capture_time == pytest.approx(1006, abs=1e-6)


@pytest.mark.parametrize("codec", AUDIO_CODECS)
def test_a_change_of_rate_or_channels_goes_on_without_a_step_back(codec: str) -> None:
    encoder = sound_encoder(codec)
    before = run(encoder, segments(16_000, [320] * 5))
    after = run(encoder, segments(48_000, [960] * 5, channels=2, start=5.1))
    assert after
    assert after[0].media_time >= before[-1].media_time + encoder.rate // 50


def test_mu_law_follows_the_recommendation() -> None:
    encoder = sound_encoder("PCMU")
    samples = np.array([0, -1, 32767, -32768, 8, -8, 1000, -1000] * 20, np.int16)
    packet = encoder.encode(Segment(samples, 8_000, 1, 1, 0.0, 0.0))[0]
    assert list(packet.data[:8]) == [0xFF, 0x7F, 0x80, 0x00, 0xFE, 0x7E, 0xCE, 0x4E]


def test_opus_goes_on_when_more_loss_is_expected() -> None:
    encoder = create_sound_encoder("opus", 32_000, 5)
    packets = []
    for i in range(40):
        if i == 20:
            encoder.expect_loss(30)
        medium = sound(i + 1, i / 50, rate=48_000)
        samples = np.frombuffer(medium.payload, "<i2")
        packets += encoder.encode(Segment(samples, 48_000, 1, medium.stamp, medium.time, medium.time))
    assert [packet.media_time for packet in packets] == [i * 960 for i in range(len(packets))]
    decoder: Any = av.CodecContext.create("libopus", "r")
    decoder.sample_rate = 48_000
    levels = [
        float(np.abs(frame.to_ndarray()).mean())
        for packet in packets
        for frame in decoder.decode(av.Packet(packet.data))
    ]
    assert min(levels[5:]) > 0.5 * max(levels)


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_a_running_encoder_follows_a_lower_bitrate_without_a_keyframe(codec: str) -> None:
    encoder = video_encoder(codec)
    encoder.aim(2_000_000, 30.0)
    ample = encode(encoder, [noise(i, 0.0) for i in range(1, 31)])
    encoder.aim(800_000, 30.0)
    decoder = PictureDecoder()
    scarce = [encoder.encode(decoder.decode(noise(i, 0.0)), i * 3000, False) for i in range(31, 91)]
    assert not any(item.keyframe for item in scarce)
    assert sum(len(item.data) for item in scarce[30:]) < 0.8 * sum(len(item.data) for item in ample)


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_a_bitrate_beyond_what_steering_can_do_begins_with_a_keyframe(codec: str) -> None:
    encoder = video_encoder(codec)
    encoder.aim(400_000, 30.0)
    encode(encoder, [picture(1, 0.0), picture(2, 0.0)])
    encoder.aim(50_000, 30.0)
    decoder = PictureDecoder()
    assert encoder.encode(decoder.decode(picture(3, 0.0)), 9000, False).keyframe


@pytest.mark.parametrize("codec", VIDEO_CODECS)
def test_a_keyframe_of_a_starved_path_still_shows_the_picture(codec: str) -> None:
    """Beyond the quantisers of H.264, x264 leaves nothing of it but grey."""
    encoder = create_picture_encoder(codec, 30_000, 30.0)
    media = [with_event_strip(noise(number, 0.0)) for number in range(1, 41)]
    encoded = encode(encoder, media, keys=(0, 10, 20, 30))
    context: Any = av.CodecContext.create(DECODERS[codec], "r")
    frames = [frame for each in encoded if each.data for frame in context.decode(av.Packet(each.data))]
    shown = {read_event_strip(frame.to_ndarray(format="gray")) for frame in frames}
    assert {11, 21, 31} <= shown
