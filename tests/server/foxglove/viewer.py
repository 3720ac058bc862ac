"""A viewer: speaks the protocol of Foxglove's WebSocket, and decodes by the schemas that the server sends."""

import asyncio
import base64
import json
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import jsonschema
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessages
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from tests.waiting import PATIENCE

__all__ = ["Received", "Viewer", "viewing"]

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
MESSAGE = struct.Struct("<BIQ")  # opcode, subscription, time in ns
MESSAGE_DATA = 1


class Received(NamedTuple):
    topic: str
    time: int  # ns since 1970
    message: Any  # a protobuf message, or decoded JSON


class Viewer:
    """Knows the offered topics, and keeps what it gets."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}  # by topic
        self.received: list[Received] = []
        self._decoders: dict[int, tuple[str, Callable[[bytes], Any]]] = {}  # by subscription
        self._news = asyncio.Event()

    async def listen(self) -> None:
        async for frame in self.socket:
            if isinstance(frame, str):
                self._take_text(json.loads(frame))
            else:
                opcode, subscription, time = MESSAGE.unpack_from(frame)
                assert opcode == MESSAGE_DATA
                topic, decode = self._decoders[subscription]
                self.received.append(Received(topic, time, decode(frame[MESSAGE.size :])))
            self._news.set()

    def _take_text(self, message: dict[str, Any]) -> None:
        match message["op"]:
            case "serverInfo":
                self.info = message
            case "advertise":
                self.channels |= {each["topic"]: each for each in message["channels"]}
            case "unadvertise":
                gone = set(message["channelIds"])
                self.channels = {topic: each for topic, each in self.channels.items() if each["id"] not in gone}

    async def subscribe(self, *topics: str) -> None:
        """Subscribe to topics as soon as they are offered."""
        await self.until(lambda: self.channels.keys() >= set(topics))
        wanted = []
        for topic in topics:
            number = len(self._decoders) + 1
            self._decoders[number] = (topic, _decoder(self.channels[topic]))
            wanted.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    async def unsubscribe_all(self) -> None:
        await self.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": list(self._decoders)}))

    async def until(self, found: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not found():
                self._news.clear()
                await self._news.wait()

    async def next_of(self, topic: str, found: Callable[[Any], bool] = lambda _: True) -> Received:
        """The first message of a topic, received already or to come, that `found` says yes to."""
        await self.until(lambda: any(each.topic == topic and found(each.message) for each in self.received))
        return next(each for each in self.received if each.topic == topic and found(each.message))

    def of(self, topic: str) -> list[Any]:
        return [each.message for each in self.received if each.topic == topic]


def _decoder(channel: dict[str, Any]) -> Callable[[bytes], Any]:
    if channel["encoding"] == "protobuf":
        files = FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
        kind: type[Message] = GetMessages(files.file)[channel["schemaName"]]
        return kind.FromString
    validator = jsonschema.Draft202012Validator(json.loads(channel["schema"]))

    def decode(data: bytes) -> Any:
        message = json.loads(data)
        validator.validate(message)
        return message

    return decode


@asynccontextmanager
async def viewing(port: int) -> AsyncIterator[Viewer]:
    """A viewer that is connected to the port of this machine."""
    async with (
        connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], max_size=None) as socket,
        asyncio.TaskGroup() as tasks,
    ):
        viewer = Viewer(socket)
        listening = tasks.create_task(viewer.listen())
        yield viewer
        listening.cancel()
