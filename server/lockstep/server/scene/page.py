"""viser's client: one HTML file, read once and kept in memory, with the script that gates it before all of its own."""

import gzip
from pathlib import Path
from typing import NamedTuple
from urllib.request import ProxyHandler, build_opener

__all__ = ["HOOK", "ScenePage", "read_scene_page", "scene_page"]

READ_SECONDS = 5.0
MAX_BYTES = 16 << 20

HOOK = b"<head><script>" + (Path(__file__).parent / "scene_frame.js").read_bytes() + b"</script>"


class ScenePage(NamedTuple):
    plain: bytes
    packed: bytes  # gzip


def scene_page(client: bytes) -> ScenePage:
    """From the HTML of viser's client. Raises ValueError when it has no head."""
    if b"<head>" not in client:
        raise ValueError("viser's client has no <head>")
    plain = client.replace(b"<head>", HOOK, 1)
    return ScenePage(plain, gzip.compress(plain, mtime=0))


def read_scene_page(port: int) -> ScenePage:
    """Blocks: from viser on loopback.

    Raises:
        OSError, ValueError: it cannot be had.
    """
    opener = build_opener(ProxyHandler({}))
    with opener.open(f"http://127.0.0.1:{port}/", timeout=READ_SECONDS) as answer:
        return scene_page(answer.read(MAX_BYTES))
