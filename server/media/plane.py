"""The media plane: streams of one robot, fanned out to every peer."""

from aiortc import RTCPeerConnection
from prometheus_client import CollectorRegistry

from robot_bridge.protocol.console import StreamInfo
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.messages import Media
from server.media.settings import MediaSettings

__all__ = ["MediaPlane", "MediaSettings", "PeerMedia"]


class PeerMedia:
    """What one peer gets."""

    streams: list[StreamInfo]  # valid after setLocalDescription(answer)
    stats: dict[str, int]

    async def close(self) -> None:
        """Stop sending to this peer. Idempotent; also safe after the peer connection closed."""
        raise NotImplementedError


class MediaPlane:
    """Encodes each stream once per codec and sends it to every attached peer."""

    def __init__(self, settings: MediaSettings, metrics_registry: CollectorRegistry) -> None:
        raise NotImplementedError

    def configure(self, description: RobotDescription) -> None:
        """Create the streams of a robot; once per epoch, when no peer is attached."""
        raise NotImplementedError

    def feed(self, media: Media, now: float) -> None:
        """Take a picture or sound from the robot link. Called on the loop, never blocks; newest wins."""
        raise NotImplementedError

    def attach(self, pc: RTCPeerConnection, offer_sdp: str, *, priority: bool, trailer: bool) -> PeerMedia:
        """Give a peer its streams. Call after setRemoteDescription(offer), before createAnswer.

        `priority` is for the operator: served first and at once.
        """
        raise NotImplementedError

    async def close(self) -> None:
        """Stop all streams and workers. Idempotent."""
        raise NotImplementedError
