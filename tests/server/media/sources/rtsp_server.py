"""A network camera for tests: as much of RTSP 1.0 (RFC 2326) as a player needs, RTP over the same connection."""

import asyncio
import base64
import struct
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from lockstep.server.media.codecs.h264 import START_CODE, inspect
from lockstep.server.media.codecs.packetise import packetise_h264, split_nal_units
from tests.server.media.camera_h264 import access_units

__all__ = ["RtspCamera", "running_camera", "slices_of"]

RATE = 30
USER, PASSWORD = "viewer", "geheim"


class RtspCamera:
    """Serves one film again and again to whoever asks with the right password."""

    def __init__(self) -> None:
        self._units = access_units(30, gop=15, profile="main")
        self.port = 0
        self.requests: list[str] = []
        self.captured: dict[bytes, float] = {}  # when a picture was last sent, by its slices; monotonic
        self._players: set[asyncio.Task[None]] = set()

    @property
    def url(self) -> str:
        return f"rtsp://{USER}:{PASSWORD}@127.0.0.1:{self.port}/main"

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while head := await reader.readuntil(b"\r\n\r\n"):
                if head[:1] == b"$":
                    continue  # a receiver report
                method, *_ = text = head.decode().split(" ", 2)
                self.requests.append(method)
                writer.write(self._answer(method, head.decode(), text[1]))
                if method == "PLAY":
                    task = asyncio.create_task(self._play(writer))
                    self._players.add(task)
                    task.add_done_callback(self._players.discard)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()

    def hang_up(self) -> None:
        for task in self._players:
            task.cancel()

    def _answer(self, method: str, head: str, url: str) -> bytes:
        sequence = next(line.split(":")[1].strip() for line in head.splitlines() if line.lower().startswith("cseq"))
        expected = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
        headers, body = [f"CSeq: {sequence}"], ""
        if method == "OPTIONS":
            headers.append("Public: DESCRIBE, SETUP, PLAY, TEARDOWN, GET_PARAMETER")
        elif f"Basic {expected}" not in head:
            return (
                f'RTSP/1.0 401 Unauthorized\r\nCSeq: {sequence}\r\nWWW-Authenticate: Basic realm="c"\r\n\r\n'.encode()
            )
        elif method == "DESCRIBE":
            body = self._description()
            headers += [f"Content-Base: {url}/", "Content-Type: application/sdp", f"Content-Length: {len(body)}"]
        elif method == "SETUP":
            headers += ["Transport: RTP/AVP/TCP;unicast;interleaved=0-1", "Session: 1"]
        else:
            headers.append("Session: 1")
        return ("RTSP/1.0 200 OK\r\n" + "\r\n".join(headers) + "\r\n\r\n" + body).encode()

    def _description(self) -> str:
        sets = list(split_nal_units(inspect(self._units[0]).parameter_sets))
        sprop = ",".join(base64.b64encode(nal).decode() for nal in sets)
        profile = sets[0][1:4].hex()
        lines = ["v=0", "o=- 0 0 IN IP4 127.0.0.1", "s=camera", "t=0 0", "m=video 0 RTP/AVP 96", "c=IN IP4 0.0.0.0"]
        lines += ["a=rtpmap:96 H264/90000", "a=control:track0"]
        lines += [f"a=fmtp:96 packetization-mode=1;profile-level-id={profile};sprop-parameter-sets={sprop}", ""]
        return "\r\n".join(lines)

    async def _play(self, writer: asyncio.StreamWriter) -> None:
        began, sequence, number = time.monotonic(), 0, 0
        try:
            while not writer.is_closing():
                # Its parameter sets are in the description alone, as with many cameras.
                unit = b"".join(
                    START_CODE + nal for nal in split_nal_units(self._units[number % 30]) if nal[0] & 0x1F not in (7, 8)
                )
                self.captured[slices_of(unit)] = time.monotonic()
                payloads = packetise_h264(unit)
                for i, payload in enumerate(payloads):
                    marker = 0x80 if i == len(payloads) - 1 else 0
                    rtp = struct.pack("!BBHII", 0x80, marker | 96, sequence & 0xFFFF, number * 3000, 7) + payload
                    writer.write(struct.pack("!cBH", b"$", 0, len(rtp)) + rtp)
                    sequence += 1
                await writer.drain()
                number += 1
                await asyncio.sleep(max(0.0, began + number / RATE - time.monotonic()))
        except ConnectionError:
            pass
        finally:
            writer.close()


def slices_of(unit: bytes) -> bytes:
    """A picture without what may be put in front of it on its way (H.264 table 7-1)."""
    return b"".join(nal for nal in split_nal_units(unit) if 1 <= nal[0] & 0x1F <= 5)


@asynccontextmanager
async def running_camera(port: int = 0) -> AsyncIterator[RtspCamera]:
    camera = RtspCamera()
    server = await asyncio.start_server(camera.serve, "127.0.0.1", port)
    camera.port = server.sockets[0].getsockname()[1]
    try:
        yield camera
    finally:
        server.close()
        camera.hang_up()
        await asyncio.sleep(0)
