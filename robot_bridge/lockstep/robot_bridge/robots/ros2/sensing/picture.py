"""Converts sensor_msgs/Image and CompressedImage into pictures for the robot link. No I/O."""

from typing import TYPE_CHECKING, Final, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.ros2.sensing.jpeg_size import jpeg_size

if TYPE_CHECKING:
    from typing_extensions import Buffer

__all__ = ["ENCODINGS", "BadPicture", "CompressedMessage", "ImageMessage", "Payload", "from_compressed", "from_image"]

Pixels = npt.NDArray[np.uint8]

# Encoding -> bytes per pixel, and the places of red, green and blue (sensor_msgs/image_encodings.hpp).
_COLOUR: Final = {
    "rgb8": (3, (0, 1, 2)),
    "bgr8": (3, (2, 1, 0)),
    "rgba8": (4, (0, 1, 2)),
    "bgra8": (4, (2, 1, 0)),
    "8UC3": (3, (2, 1, 0)),
}
_GREY: Final = ("mono8", "8UC1")
# Encoding -> the places of the first Y, U and V in the four bytes of two pixels.
_YUV422: Final = {
    "yuv422": (1, 0, 2),
    "uyvy": (1, 0, 2),
    "yuv422_yuy2": (0, 1, 3),
    "yuyv": (0, 1, 3),
}
ENCODINGS: Final = frozenset({*_COLOUR, *_GREY, *_YUV422})


class BadPicture(ValueError):
    """A picture that cannot be used; the text names the fault, without figures, for counting."""


class ImageMessage(Protocol):
    """The fields of sensor_msgs/Image that matter."""

    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def encoding(self) -> str: ...
    @property
    def step(self) -> int: ...
    @property
    def data(self) -> "Buffer": ...


class CompressedMessage(Protocol):
    """The fields of sensor_msgs/CompressedImage that matter."""

    @property
    def format(self) -> str: ...
    @property
    def data(self) -> "Buffer": ...


class Payload(NamedTuple):
    codec: Literal["yuv420p", "mjpeg"]
    data: bytes


def from_image(image: ImageMessage, width: int, height: int) -> Payload:
    """Convert a picture into planes Y, U, V in limited range.

    Raises:
        BadPicture: the size is not `width` x `height`, the encoding is not supported, or bytes are missing.
    """
    if (image.width, image.height) != (width, height):
        raise BadPicture(f"picture of another size than {width}x{height}")
    encoding = image.encoding
    if encoding in _COLOUR:
        depth, order = _COLOUR[encoding]
        return Payload("yuv420p", _from_rgb(_rows(image, depth), order))
    if encoding in _GREY:
        return Payload("yuv420p", _from_grey(_rows(image, 1)[:, :, 0]))
    if encoding in _YUV422:
        return Payload("yuv420p", _from_yuv422(_rows(image, 2), _YUV422[encoding]))
    raise BadPicture(f"picture in encoding {encoding[:20]!r}, which is not supported")


def from_compressed(image: CompressedMessage, width: int, height: int) -> Payload:
    """Return a JPEG unchanged.

    Raises:
        BadPicture: not a JPEG, or its size is not `width` x `height`.
    """
    data = bytes(image.data)
    size = jpeg_size(data)
    if size is None:
        raise BadPicture(f"picture in format {image.format[:20]!r} that is not JPEG")
    if size != (width, height):
        raise BadPicture(f"picture of another size than {width}x{height}")
    return Payload("mjpeg", data)


def _rows(image: ImageMessage, depth: int) -> Pixels:
    """Return the pixels without the padding of the rows: height x width x depth."""
    step, data = image.step, memoryview(image.data)
    if step < image.width * depth or data.nbytes < step * image.height:
        raise BadPicture("picture with too few bytes")
    rows = np.frombuffer(data, np.uint8, count=step * image.height).reshape(image.height, step)
    return rows[:, : image.width * depth].reshape(image.height, image.width, depth)


def _from_rgb(pixels: Pixels, order: tuple[int, int, int]) -> bytes:
    """Convert by BT.601 in integers; chroma is the mean of four pixels."""
    red, green, blue = (pixels[:, :, channel].astype(np.uint16) for channel in order)
    luma = ((66 * red + 129 * green + 25 * blue + 128) >> 8) + 16
    r, g, b = (_quartered(channel).astype(np.int32) for channel in (red, green, blue))  # four times the mean
    u = ((-38 * r - 74 * g + 112 * b + 512) >> 10) + 128
    v = ((112 * r - 94 * g - 18 * b + 512) >> 10) + 128
    return _planes(luma, u, v)


def _quartered(channel: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """Return sums of two by two pixels; beyond an odd side the last pixel counts twice."""
    height, width = channel.shape
    if height % 2 or width % 2:
        channel = np.pad(channel, ((0, height % 2), (0, width % 2)), mode="edge")
    rows = channel[0::2] + channel[1::2]
    return rows[:, 0::2] + rows[:, 1::2]


def _from_grey(pixels: Pixels) -> bytes:
    luma = ((pixels.astype(np.uint16) * 220) >> 8) + 16  # 0 to 255 becomes 16 to 235
    height, width = (int(side) for side in luma.shape)
    chroma = 2 * ((height + 1) // 2) * ((width + 1) // 2)
    return luma.astype(np.uint8).tobytes() + bytes([128]) * chroma


def _from_yuv422(pixels: Pixels, order: tuple[int, int, int]) -> bytes:
    """Convert a 4:2:2 picture; each two rows share their chroma.

    Raises:
        BadPicture: the width is odd, though two pixels share four bytes.
    """
    first, u_at, v_at = order
    height, width, _ = pixels.shape
    if width % 2:
        raise BadPicture("picture of an odd width in a 4:2:2 encoding")
    if height % 2:
        pixels = np.concatenate((pixels, pixels[-1:]))
    pairs = pixels.reshape(-1, width // 2, 4)
    luma = pixels[:height, :, first % 2]
    u, v = (
        (pairs[0::2, :, at].astype(np.uint16) + pairs[1::2, :, at].astype(np.uint16) + 1) >> 1 for at in (u_at, v_at)
    )
    return _planes(luma, u, v)


def _planes(*planes: npt.NDArray[np.generic]) -> bytes:
    return b"".join(plane.astype(np.uint8).tobytes() for plane in planes)
