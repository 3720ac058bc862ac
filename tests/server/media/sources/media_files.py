"""Short films and sounds for tests, made by the libraries that read them."""

import wave
from pathlib import Path
from typing import Any

import av
import numpy as np

__all__ = ["film", "tone"]

WIDTH, HEIGHT = 160, 120


def film(
    path: Path,
    codec: str = "libx264",
    *,
    count: int = 30,
    b_frames: int = 0,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> Path:
    width, height = size
    pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=30)
        stream.width, stream.height, stream.pix_fmt = width, height, pix_fmt
        stream.codec_context.gop_size = 10
        stream.codec_context.max_b_frames = b_frames
        if codec == "libx264":
            stream.options = {"x264-params": "scenecut=0"}  # keyframes come when they are due
        for number in range(count):
            luma = np.full((height * 3 // 2, width), 40 + 5 * (number % 30), np.uint8)
            luma[:, (11 * number) % width] = 230
            frame = av.VideoFrame.from_ndarray(luma, format="yuv420p").reformat(format=pix_fmt)
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def tone(path: Path, frequency: float = 440.0, seconds: float = 1.0, rate: int = 16_000) -> Path:
    phase = np.arange(int(seconds * rate)) * frequency * 2 * np.pi / rate
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes((np.sin(phase) * 8000).astype("<i2").tobytes())
    return path
