"""The session's room in one Janus (https://janus.conf.meetecho.com/docs/videoroom.html)."""

from collections.abc import Mapping
from dataclasses import dataclass

from lockstep.protocol.console import StreamInfo
from lockstep.server.media.codecs.codec_choice import OFFERED_PROFILE
from lockstep.server.sfu.errors import RelayRefused
from lockstep.server.sfu.janus_session import JanusSession

__all__ = ["JanusRoom", "RoomKeys"]

NO_SUCH_ROOM = 426  # JANUS_VIDEOROOM_ERROR_NO_SUCH_ROOM
ROOM_EXISTS = 427
PLAYOUT_DELAY_ID = 2  # of the header extension in the console's offers: the second that they name
CODECS = {"H264": "h264", "VP8": "vp8", "opus": "opus", "PCMU": "pcmu"}


@dataclass(frozen=True, repr=False)
class RoomKeys:
    """Keys of a room. Observers are told `pin` alone; no key is ever logged."""

    admin_key: str  # required to create rooms in this Janus; "" if it requires no key
    secret: str  # required to change the room
    publisher: str  # token required to publish in a room of this console
    pin: str  # required to join


class JanusRoom:
    """Creates and fills the room, and passes it on. All requests raise RelayError."""

    def __init__(self, session: JanusSession, room: int, keys: RoomKeys) -> None:
        self._session = session
        self._room = room
        self._keys = keys

    async def prepare(self, handle: int) -> None:
        """Create the room, or give it the new pin, so that an older pin no longer opens it.

        A room that somebody else made keeps its pin; it has to be the one in `keys`.
        """
        exists = await self._session.message(handle, {"request": "exists", "room": self._room})
        if exists.data.get("exists") is not True:
            await self._create(handle)
            return
        await self._session.message(
            handle, {"request": "edit", "room": self._room, "secret": self._keys.secret, "new_pin": self._keys.pin}
        )

    async def _create(self, handle: int) -> None:
        keys = self._keys
        request: dict[str, object] = {
            "request": "create",
            "room": self._room,
            "description": "Lockstep",
            "is_private": True,
            "permanent": False,
            "secret": keys.secret,
            "pin": keys.pin,
            "allowed": [keys.publisher],
            "publishers": 4,  # pictures and feedback are two, for a moment twice
            "videocodec": "h264,vp8",
            "audiocodec": "opus,pcmu",
            "bitrate": 0,
            "fir_freq": 0,
            "audiolevel_ext": False,
            "transport_wide_cc_ext": False,
            "notify_joining": False,
        }
        if keys.admin_key:
            request["admin_key"] = keys.admin_key
        try:
            await self._session.message(handle, request)
        except RelayRefused as error:
            if error.code != ROOM_EXISTS:
                raise

    async def publish(self, handle: int, feed: int, offer: str, streams: Mapping[str, str]) -> str:
        """Join and publish; return the answer. `streams`: names by mid, for subscribers."""
        answer = await self._session.message(
            handle,
            {
                "request": "joinandconfigure",
                "ptype": "publisher",
                "room": self._room,
                "id": feed,
                "pin": self._keys.pin,
                "token": self._keys.publisher,
                "display": "lockstep",
                "descriptions": [{"mid": mid, "description": name} for mid, name in streams.items()],
            },
            {"type": "offer", "sdp": offer},
        )
        if answer.jsep is None:
            raise RelayRefused("the relay did not answer the offer")
        return str(answer.jsep["sdp"])

    async def receive_from(self, handle: int, feed: int, streams: list[StreamInfo]) -> "Inlet":
        """Expect `feed` from another Janus; return the ports to send it to."""
        answer = await self._session.message(
            handle,
            {
                "request": "add_remote_publisher",
                "room": self._room,
                "secret": self._keys.secret,
                "id": feed,
                "display": "lockstep",
                "streams": [
                    {
                        "type": each.kind,
                        "mindex": index,
                        "mid": each.mid,
                        "codec": CODECS[each.codec],
                        "description": each.stream,
                        **({"playoutdelay_ext_id": PLAYOUT_DELAY_ID} if each.kind == "video" else {}),
                        **({"h264-profile": OFFERED_PROFILE} if each.codec == "H264" else {}),
                    }
                    for index, each in enumerate(streams)
                ]
                + [{"type": "data", "mindex": len(streams), "mid": str(len(streams)), "codec": "data"}],
            },
        )
        port, control = (answer.data.get(name) for name in ("port", "rtcp_port"))
        if not isinstance(port, int) or not isinstance(control, int):
            raise RelayRefused("the relay's answer has no ports")
        return Inlet(port, control)

    async def send_to(self, handle: int, feed: int, name: str, host: str, inlet: "Inlet") -> None:
        """Pass `feed` on to another Janus."""
        await self._session.message(
            handle,
            {
                "request": "publish_remotely",
                "room": self._room,
                "secret": self._keys.secret,
                "publisher_id": feed,
                "remote_id": name,
                "host": host,
                "port": inlet.port,
                "rtcp_port": inlet.control_port,
            },
        )

    async def stop_sending(self, handle: int, feed: int, name: str) -> None:
        """Stop passing `feed` on."""
        await self._session.message(
            handle,
            {
                "request": "unpublish_remotely",
                "room": self._room,
                "secret": self._keys.secret,
                "publisher_id": feed,
                "remote_id": name,
            },
        )

    async def forget(self, handle: int, feed: int) -> None:
        """Remove a feed that came from another Janus."""
        await self._session.message(
            handle,
            {"request": "remove_remote_publisher", "room": self._room, "secret": self._keys.secret, "id": feed},
        )


@dataclass(frozen=True)
class Inlet:
    """Ports on which a Janus expects a feed from another one."""

    port: int
    control_port: int
