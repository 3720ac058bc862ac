from robot_bridge.protocol.carriers import EVENT_REFERENCE_URI, unpack_event_reference
from server.media.plane import MediaPlane
from tests.server.media.viewer import Viewer, noise, running_plane, viewing


async def stream_pictures(plane: MediaPlane, viewer: Viewer, count: int, first: int = 1) -> None:
    """Feed pictures one by one, each as soon as the one before arrived."""
    for i in range(first, first + count):
        seen = len({received.packet.timestamp for received in viewer.of("video")})
        plane.feed(noise(i, 10 + i / 30), i / 30)
        await viewer.until(lambda: len({r.packet.timestamp for r in viewer.of("video")}) > seen)  # noqa: B023


async def test_every_packet_carries_the_stamp_that_was_fed() -> None:
    async with running_plane() as plane, viewing(plane, uris={EVENT_REFERENCE_URI: 9}) as viewer:
        await stream_pictures(plane, viewer, 10)
        stamps = [unpack_event_reference(r.extensions[EVENT_REFERENCE_URI]) for r in viewer.of("video")]
        assert set(stamps) == set(range(1, 11))
        assert len(stamps) > 10
