"""Drive and watch with aiortc and nothing of Lockstep's: python drive.py LINK [--seconds S] [--value V]

Its one package is aiortc. LINK is an operator's, as `lockstep up` prints it. docs/console-api.md describes everything
that this script says and hears. It moves the robot's first axis, at first with a neutral command, and rests at the end.
"""

import argparse
import asyncio
import json
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from aiortc import MediaStreamTrack, RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription

SECONDS_TO_CONNECT = 30.0
REPEAT_SECONDS = 0.2  # a command that nobody has answered is sent again under the same event: it executes once at most


class Pilot:
    """One session: `feedback` is the newest, `refusals` count by reason, `pictures` are decoded."""

    def __init__(self) -> None:
        self.feedback: dict[str, Any] = {}
        self.refusals: dict[str, int] = {}
        self.pictures = 0
        self.me = ""
        self.holder = ""
        self._news = asyncio.Event()
        self._peer = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self._channels = {
            "control": self._channel("control", ordered=False, maxRetransmits=0),  # the newest is all that counts
            "session": self._channel("session"),
            "stop": self._channel("stop"),
        }
        self._peer.addTransceiver("video", direction="recvonly")
        self._peer.on("track", self._track)
        self._watching: set[asyncio.Task[None]] = set()

    def _channel(self, name: str, **how: Any) -> RTCDataChannel:
        channel = self._peer.createDataChannel(name, **how)
        channel.on("message", self._hear)
        return channel

    async def connect(self, link: str) -> None:
        parts = urlsplit(link)
        console, token = f"{parts.scheme}://{parts.netloc}", parts.fragment.removeprefix("token=")
        await self._peer.setLocalDescription(await self._peer.createOffer())
        headers = {"Content-Type": "application/sdp", "Authorization": f"Bearer {token}"}
        offer = self._peer.localDescription.sdp.encode()
        answer = await asyncio.to_thread(_post, urllib.request.Request(f"{console}/whep", offer, headers))
        await self._peer.setRemoteDescription(RTCSessionDescription(answer, "answer"))
        await self._until(lambda: bool(self.feedback and self.me))

    async def take_seat(self) -> None:
        self._say("session", {"type": "seat_request"})
        await self._until(lambda: self.holder == self.me)

    async def drive(self, values: list[float]) -> dict[str, Any]:
        """The next event, as the answer to the newest feedback: its feedback.

        It is a neutral one if the robot wants that first: at the beginning, after a stop, after it was held up.
        """
        event = self.feedback["event"] + 1
        while self.feedback["event"] < event:
            wanted = [0.0] * len(values) if self.feedback.get("neutral_needed") else values
            command: dict[str, Any] = {"type": "command", "event": event, "values": wanted}
            command |= {name: self.feedback[name] for name in ("issue", "nonce") if name in self.feedback}
            self._say("control", command)
            try:
                async with asyncio.timeout(REPEAT_SECONDS):
                    await self._until(lambda: bool(self.feedback["event"] >= event))
            except TimeoutError:
                continue
        return self.feedback

    async def close(self) -> None:
        self._say("control", {"type": "rest", "event": self.feedback.get("event", 1)})
        self._say("session", {"type": "seat_release"})
        for task in self._watching:
            task.cancel()
        await self._peer.close()

    def _say(self, channel: str, message: dict[str, Any]) -> None:
        if self._channels[channel].readyState == "open":
            self._channels[channel].send(json.dumps(message))

    def _hear(self, text: str) -> None:
        message = json.loads(text)
        match message["type"]:
            case "feedback":
                if message["event"] >= self.feedback.get("event", 0):
                    self.feedback = message
            case "welcome":
                self.me = message["peer"]
            case "seat":
                self.holder = message["holder"]
            case "refusal":
                self.refusals[message["reason"]] = self.refusals.get(message["reason"], 0) + 1
            case "ping":
                self._say("control", {"type": "pong", "id": message["id"]})
        self._news.set()

    async def _until(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(SECONDS_TO_CONNECT):
            while not holds():
                self._news.clear()
                await self._news.wait()

    def _track(self, track: MediaStreamTrack) -> None:
        self._watching.add(asyncio.create_task(self._watch(track)))

    async def _watch(self, track: MediaStreamTrack) -> None:
        while True:
            await track.recv()
            self.pictures += 1


def _post(request: urllib.request.Request) -> str:
    try:
        with urllib.request.urlopen(request, timeout=SECONDS_TO_CONNECT) as answer:
            return str(answer.read().decode())
    except urllib.error.HTTPError as error:
        raise SystemExit(f"the console refused: {error.code} {error.read().decode()}") from error


async def main(link: str, seconds: float, value: float) -> None:
    pilot = Pilot()
    await pilot.connect(link)
    await pilot.take_seat()
    axes = len(pilot.feedback["axes"])
    try:
        end = asyncio.get_running_loop().time() + seconds
        while asyncio.get_running_loop().time() < end:
            feedback = await pilot.drive([value] + [0.0] * (axes - 1))
            print(f"event {feedback['event']}: axes {feedback['axes']}, {pilot.pictures} pictures")
            await asyncio.sleep(0.05)
    finally:
        await pilot.close()
        print(json.dumps({"pictures": pilot.pictures, "event": pilot.feedback["event"], "refusals": pilot.refusals}))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("link")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--value", type=float, default=0.1)
    asked = parser.parse_args()
    asyncio.run(main(asked.link, asked.seconds, asked.value))
