"""Pictures of every supported encoding become the same planes; the others are named."""

import array
from dataclasses import dataclass

import av
import numpy as np
import numpy.typing as npt
import pytest

from lockstep.robot_bridge.robots.ros2.sensing.picture import BadPicture, Payload, from_compressed, from_image

WIDTH, HEIGHT = 128, 64


@dataclass
class Image:
    encoding: str
    data: array.array  # type: ignore[type-arg]
    step: int
    width: int = WIDTH
    height: int = HEIGHT


@dataclass
class Compressed:
    data: array.array  # type: ignore[type-arg]
    format: str = "jpeg"


def smooth() -> npt.NDArray[np.uint8]:
    """RGB that changes slowly, so that all ways of halving the colours agree."""
    x, y = np.meshgrid(np.linspace(0, 1, WIDTH), np.linspace(0, 1, HEIGHT))
    return np.stack([255 * x, 255 * y, 255 * (1 - x)], axis=2).astype(np.uint8)


def image(encoding: str, pixels: npt.NDArray[np.uint8], padding: int = 0) -> Image:
    rows = pixels.reshape(HEIGHT, -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
    return Image(encoding, array.array("B", padded.tobytes()), padded.shape[1])


def rgb_of(payload: Payload) -> npt.NDArray[np.int16]:
    """As a decoder shows it."""
    planes = np.frombuffer(payload.data, np.uint8).reshape(HEIGHT * 3 // 2, WIDTH)
    frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
    return frame.to_ndarray(format="rgb24").astype(np.int16)


ORDERS = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "8UC3": [2, 1, 0]}


@pytest.mark.parametrize("encoding", ORDERS)
@pytest.mark.parametrize("padding", [0, 5])
def test_colours_come_out_as_they_went_in(encoding: str, padding: int) -> None:
    payload = from_image(image(encoding, smooth()[:, :, ORDERS[encoding]], padding), WIDTH, HEIGHT)
    assert payload.codec == "yuv420p"
    assert abs(rgb_of(payload) - smooth()).max() < 24  # chroma is halved: edges of the picture are off by a step
    assert abs(rgb_of(payload) - smooth()).mean() < 4


@pytest.mark.parametrize("encoding", ["rgba8", "bgra8"])
def test_transparency_is_left_out(encoding: str) -> None:
    order = [0, 1, 2] if encoding == "rgba8" else [2, 1, 0]
    pixels = np.concatenate([smooth()[:, :, order], np.zeros((HEIGHT, WIDTH, 1), np.uint8)], axis=2)
    payload = from_image(image(encoding, pixels), WIDTH, HEIGHT)
    assert abs(rgb_of(payload) - smooth()).mean() < 4


def test_primary_colours_have_the_values_of_bt_601() -> None:
    red = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    red[:, :, 0] = 255
    planes = np.frombuffer(from_image(image("rgb8", red), WIDTH, HEIGHT).data, np.uint8)
    luma, u, v = np.split(planes, [WIDTH * HEIGHT, WIDTH * HEIGHT * 5 // 4])
    assert (set(luma), set(u), set(v)) == ({82}, {90}, {240})


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_grey_spans_the_limited_range(encoding: str) -> None:
    grey = np.zeros((HEIGHT, WIDTH), np.uint8)
    grey[:, WIDTH // 2 :] = 255
    planes = np.frombuffer(from_image(image(encoding, grey), WIDTH, HEIGHT).data, np.uint8)
    luma, chroma = planes[: WIDTH * HEIGHT], planes[WIDTH * HEIGHT :]
    assert (luma.min(), luma.max()) == (16, 235)
    assert set(chroma) == {128}


@pytest.mark.parametrize(
    ("encoding", "name"), [("yuv422", "uyvy422"), ("uyvy", "uyvy422"), ("yuv422_yuy2", "yuyv422"), ("yuyv", "yuyv422")]
)
def test_yuv422_keeps_its_luma_and_halves_its_chroma(encoding: str, name: str) -> None:
    frame = av.VideoFrame.from_ndarray(smooth(), format="rgb24").reformat(format=name)
    packed = np.frombuffer(bytes(frame.planes[0]), np.uint8).reshape(HEIGHT, frame.planes[0].line_size)
    payload = from_image(image(encoding, packed[:, : 2 * WIDTH]), WIDTH, HEIGHT)
    assert abs(rgb_of(payload) - smooth()).mean() < 4


@pytest.mark.parametrize("encoding", ["rgb8", "mono8", "yuyv"])
@pytest.mark.parametrize(("width", "height"), [(126, 63), (127, 64), (127, 63)])
def test_an_odd_side_has_colours_for_half_of_it_rounded_up(encoding: str, width: int, height: int) -> None:
    depth = {"rgb8": 3, "mono8": 1, "yuyv": 2}[encoding]
    shade = Image(encoding, array.array("B", bytes([100]) * (width * height * depth)), width * depth)
    shade.width, shade.height = width, height
    if encoding == "yuyv" and width % 2:
        with pytest.raises(BadPicture, match="odd width"):
            from_image(shade, width, height)
        return
    planes = np.frombuffer(from_image(shade, width, height).data, np.uint8)
    assert planes.size == width * height + 2 * ((width + 1) // 2) * ((height + 1) // 2)
    assert len(set(planes[: width * height])) == len(set(planes[width * height :])) == 1


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1", "bayer_rggb8", "nv12", "", "x" * 5000])
def test_an_encoding_that_is_not_supported_is_named(encoding: str) -> None:
    with pytest.raises(BadPicture, match="is not supported") as caught:
        from_image(image(encoding, smooth()), WIDTH, HEIGHT)
    assert encoding[:20] in str(caught.value)
    assert len(str(caught.value)) < 100


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(BadPicture, match="another size than 256x64"):
        from_image(image("rgb8", smooth()), 2 * WIDTH, HEIGHT)


@pytest.mark.parametrize(("step", "size"), [(0, 99_999), (383, 99_999), (384, 384 * 64 - 1), (2**32 - 1, 99_999)])
def test_a_picture_with_too_few_bytes_is_refused(step: int, size: int) -> None:
    with pytest.raises(BadPicture, match="too few bytes"):
        from_image(Image("rgb8", array.array("B", bytes(size)), step), WIDTH, HEIGHT)


def jpeg() -> bytes:
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuvj420p"
    frame = av.VideoFrame.from_ndarray(smooth(), format="rgb24").reformat(format="yuvj420p")
    return b"".join(bytes(packet) for packet in [*encoder.encode(frame), *encoder.encode(None)])


def test_a_jpeg_passes_unchanged() -> None:
    assert from_compressed(Compressed(array.array("B", jpeg())), WIDTH, HEIGHT) == Payload("mjpeg", jpeg())


def test_a_jpeg_of_another_size_is_refused() -> None:
    with pytest.raises(BadPicture, match="another size"):
        from_compressed(Compressed(array.array("B", jpeg())), WIDTH, 2 * HEIGHT)


@pytest.mark.parametrize("data", [b"", b"\xff\xd8", b"\x89PNG\r\n", jpeg()[:20], b"\xff\xd8\xff\xe0\x00\x01" * 9])
def test_what_is_no_jpeg_is_named_by_its_format(data: bytes) -> None:
    with pytest.raises(BadPicture, match="format 'png' that is not JPEG"):
        from_compressed(Compressed(array.array("B", data), format="png"), WIDTH, HEIGHT)


def test_whatever_bytes_come_only_a_bad_picture_comes_of_them() -> None:
    random = np.random.default_rng(3)
    whole = np.frombuffer(jpeg(), np.uint8)
    for _ in range(300):
        spoilt = whole[: random.integers(0, whole.size)].copy()
        if spoilt.size:
            spoilt[random.integers(0, spoilt.size)] = random.integers(0, 256)
        try:
            payload = from_compressed(Compressed(array.array("B", spoilt.tobytes())), WIDTH, HEIGHT)
        except BadPicture:
            continue
        assert payload.codec == "mjpeg"
