"""Pictures over a WebSocket: `python -m lockstep.bench.rivals.picture_server mjpeg|foxglove tcp://HOST:PORT`.

`mjpeg` works like ROS' web_video_server: each picture a JPEG, sent to each viewer as it comes. `foxglove` gives the
same JPEGs to the Foxglove SDK's own WebSocket server as CompressedImage messages. Both take the newest picture of the
main camera from the bridge's robot link and pass on the time of its capture, so that the page knows its age.
"""

import asyncio
import io
import json
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

import av
import foxglove
import numpy as np
import uvloop
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from fastapi.responses import FileResponse
from foxglove.channels import CompressedImageChannel
from foxglove.messages import CompressedImage
from PIL import Image

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.server.http.transport.serve import bind, running, wait_for_signal

__all__ = ["main"]

Kind = Literal["mjpeg", "foxglove"]

PAGE = Path(__file__).with_name("picture_page.html")
QUALITY = 80  # of the JPEGs, 0 to 95; web_video_server's own default is 95, which only makes more bytes
BACKLOG = 2  # messages that the Foxglove server keeps for a slow viewer


class PictureServer:
    """The server. `run` runs until a signal."""

    def __init__(self, kind: Kind, address: str) -> None:
        parts = urlsplit(address)
        self._link = RobotLink(parts.hostname or "", parts.port or 0, "media", name="rival")
        self._kind = kind
        self._foxglove_port = 0
        self._viewers: set[asyncio.Queue[bytes]] = set()
        self.sent = 0  # bytes of pictures

    async def run(self) -> None:
        listener = bind("127.0.0.1", 0)
        send = self._start_foxglove() if self._kind == "foxglove" else self._broadcast
        async with self._link, running(self._app(), listener), asyncio.TaskGroup() as tasks:
            feeding = tasks.create_task(self._feed(send))
            print(json.dumps({"console": f"http://127.0.0.1:{listener.getsockname()[1]}"}), flush=True)
            await wait_for_signal()
            feeding.cancel()

    async def _feed(self, send: Callable[[int, bytes], None]) -> None:
        description = self._link.hello.description
        camera = "" if description is None else description.cameras[0].name
        async for message in self._link:
            if isinstance(message, Media) and message.stream == camera:
                jpeg = await asyncio.to_thread(_jpeg, message)
                self.sent += len(jpeg)
                send(round(message.time * 1e9), jpeg)

    def _start_foxglove(self) -> Callable[[int, bytes], None]:
        server = foxglove.start_server(host="127.0.0.1", port=0, message_backlog_size=BACKLOG)
        self._foxglove_port = server.port
        channel = CompressedImageChannel("/camera/compressed")
        return lambda captured, jpeg: channel.log(CompressedImage(data=jpeg, format="jpeg"), log_time=captured)

    def _broadcast(self, captured: int, jpeg: bytes) -> None:
        message = struct.pack(">Q", captured) + jpeg
        for queue in self._viewers:
            with suppress(asyncio.QueueEmpty):  # the newest picture replaces one that still waits
                queue.get_nowait()
            queue.put_nowait(message)

    def _app(self) -> FastAPI:
        app = FastAPI()
        app.add_api_route("/", self._page, methods=["GET"])
        app.add_api_route("/config", self._config, methods=["GET"])
        app.add_api_websocket_route("/pictures", self._view)
        return app

    async def _page(self) -> FileResponse:
        return FileResponse(PAGE)

    async def _config(self) -> dict[str, int | str]:
        return {"kind": self._kind, "foxglove": self._foxglove_port, "sent": self.sent}

    async def _view(self, socket: WebSocket) -> None:
        await socket.accept()
        queue: asyncio.Queue[bytes] = asyncio.Queue(1)
        self._viewers.add(queue)
        try:
            while True:
                await socket.send_bytes(await queue.get())
        except (WebSocketDisconnect, RuntimeError):
            pass  # the viewer has gone
        finally:
            self._viewers.discard(queue)


def _jpeg(media: Media) -> bytes:
    planes = np.frombuffer(media.payload, np.uint8).reshape(media.height * 3 // 2, media.width)
    rgb = av.VideoFrame.from_ndarray(planes, format="yuv420p").to_ndarray(format="rgb24")
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=QUALITY)
    return buffer.getvalue()


def main() -> None:
    kind: Kind = "foxglove" if sys.argv[1] == "foxglove" else "mjpeg"
    uvloop.run(PictureServer(kind, sys.argv[2]).run())


if __name__ == "__main__":
    main()
