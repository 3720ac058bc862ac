"""viser's client: one HTML file, read once and kept in memory, with the gate's script before all of its scripts."""

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
    """Make the page from the HTML of viser's client. Raises ValueError if that has no head."""
    if b"<head>" not in client:
        raise ValueError("viser's client has no <head>")
    plain = client.replace(b"<head>", HOOK, 1)
    return ScenePage(plain, gzip.compress(plain, mtime=0))


def read_scene_page(port: int) -> ScenePage:
    """Read the page from viser on loopback. Blocks.

    Raises:
        OSError, ValueError: the page cannot be read.
    """
    opener = build_opener(ProxyHandler({}))
    with opener.open(f"http://127.0.0.1:{port}/", timeout=READ_SECONDS) as answer:
        return scene_page(answer.read(MAX_BYTES))
