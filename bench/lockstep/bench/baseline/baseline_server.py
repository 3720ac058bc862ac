"""The baseline: a server that takes an afternoon to write with aiortc.

`python -m lockstep.bench.baseline.baseline_server tcp://HOST:PORT [HOST]`

It serves the same pictures of the same robot bridge, from its robot link; each peer has its own `VideoStreamTrack`,
which gives out the newest picture as soon as there is one, and aiortc encodes it for each peer alone. No stamps, no
playout-delay, VP8 as aiortc sets it up. It runs on uvloop, as the console does, and speaks just enough WHEP.
"""

import asyncio
import json
import sys
from fractions import Fraction
from pathlib import Path
from urllib.parse import urlsplit

import av
import numpy as np
import uvloop
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription, VideoStreamTrack
from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse

from lockstep.bench.harness.aioice_hosts import use_hosts
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.server.http.transport.serve import bind, running, wait_for_signal

__all__ = ["main"]

PAGE = Path(__file__).with_name("baseline_page.html")
CLOCK_RATE = 90_000  # Hz


class NewestPictureTrack(VideoStreamTrack):
    """Gives out each picture once, the newest if it is late. The presentation time is the time of capture."""

    def __init__(self) -> None:
        super().__init__()
        self._newest: Media | None = None
        self._origin: float | None = None
        self._news = asyncio.Event()

    def put(self, media: Media) -> None:
        self._newest = media
        self._news.set()

    async def recv(self) -> av.VideoFrame:
        while self._newest is None:
            self._news.clear()
            await self._news.wait()
        media, self._newest = self._newest, None
        if self._origin is None:
            self._origin = media.time
        planes = np.frombuffer(media.payload, np.uint8).reshape(media.height * 3 // 2, media.width)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = round((media.time - self._origin) * CLOCK_RATE)
        frame.time_base = Fraction(1, CLOCK_RATE)
        return frame


class BaselineServer:
    """The server. `run` runs until a signal."""

    def __init__(self, address: str, host: str = "127.0.0.1") -> None:
        """`host`: the address to listen on and to offer."""
        self._host = host
        parts = urlsplit(address)
        self._link = RobotLink(parts.hostname or "", parts.port or 0, "media", name="baseline")
        self._peers: dict[str, tuple[RTCPeerConnection, NewestPictureTrack]] = {}
        self._opened = 0

    async def run(self) -> None:
        use_hosts([self._host])
        listener = bind(self._host, 0)
        async with self._link, running(self._app(), listener), asyncio.TaskGroup() as tasks:
            feeding = tasks.create_task(self._feed())
            print(json.dumps({"console": f"http://{self._host}:{listener.getsockname()[1]}"}), flush=True)
            await wait_for_signal()
            feeding.cancel()
            for name in list(self._peers):
                await self._end(name)

    async def _feed(self) -> None:
        description = self._link.hello.description
        camera = "" if description is None else description.cameras[0].name
        async for message in self._link:
            if isinstance(message, Media) and message.stream == camera:
                for _, track in self._peers.values():
                    track.put(message)

    def _app(self) -> FastAPI:
        app = FastAPI()
        app.add_api_route("/", self._page, methods=["GET"])
        app.add_api_route("/api/ice", self._ice_servers, methods=["GET"])  # the headless client asks first
        app.add_api_route("/whep", self._offer, methods=["POST"])
        app.add_api_route("/whep/{name}", self._delete, methods=["DELETE"])
        return app

    async def _page(self) -> FileResponse:
        return FileResponse(PAGE)

    async def _ice_servers(self) -> dict[str, object]:
        return {"ice_servers": [], "expires": None}

    async def _offer(self, request: Request) -> Response:
        offer = RTCSessionDescription((await request.body()).decode(), "offer")
        pc, track = RTCPeerConnection(RTCConfiguration(iceServers=[])), NewestPictureTrack()
        self._opened += 1
        name = str(self._opened)
        self._peers[name] = pc, track
        pc.addTrack(track)
        await pc.setRemoteDescription(offer)
        await pc.setLocalDescription(await pc.createAnswer())
        headers = {"Location": f"/whep/{name}"}
        return Response(pc.localDescription.sdp, status_code=201, media_type="application/sdp", headers=headers)

    async def _delete(self, name: str) -> Response:
        await self._end(name)
        return Response(status_code=200)

    async def _end(self, name: str) -> None:
        found = self._peers.pop(name, None)
        if found is not None:
            await found[0].close()


def main() -> None:
    uvloop.run(BaselineServer(*sys.argv[1:3]).run())


if __name__ == "__main__":
    main()
