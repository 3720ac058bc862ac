"""Messages to links by role, on links that write down what they get."""

import asyncio

from lockstep.protocol.actions import Status
from lockstep.protocol.framing import FrameReader
from lockstep.protocol.maps import OccupancyMap
from lockstep.protocol.messages import Hello, LinkMessage, LinkRole, Media, decode_message
from lockstep.robot_bridge.link.admission.link_admission import LinkAdmission
from lockstep.robot_bridge.link.link_session import BridgeSession, kind_of
from lockstep.robot_bridge.link.link_transport import LinkTransport
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher
from tests.makers import feedback

MAP = OccupancyMap(id="a", width=1, height=1, resolution=0.1, cells=b"")
PICTURE = Media(stream="front", codec="h264", stamp=1, time=0.0, payload=b"", keyframe=False)
SECOND = Media(stream="front", codec="h264", stamp=1, time=0.0, payload=b"", second=True)


class Tcp(asyncio.Transport):
    def __init__(self) -> None:
        super().__init__()
        self.reader = FrameReader(1 << 24)

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        pass

    def get_write_buffer_size(self) -> int:
        return 0

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.reader.feed(bytes(data))


class Link(LinkTransport):
    def __init__(self) -> None:
        super().__init__(BridgeSession(0.0, lambda hello: hello), lambda: 0.0)
        self.connection_made(tcp := Tcp())
        self.tcp = tcp

    def kinds(self) -> list[str]:
        messages: list[LinkMessage] = [decode_message(payload) for payload in self.tcp.reader.frames()]
        return [kind_of(each) for each in messages]


class Encoding:
    """Asks for the second encoding for one link."""

    def __init__(self) -> None:
        self.taker: object = None
        self.needs_keyframe: list[tuple[str, bool]] = []

    def lost(self, stream: str, *, second: bool = False) -> None:
        self.needs_keyframe.append((stream, second))

    def takes_second(self, link: object, stream: str) -> bool:
        return link is self.taker


class Rig:
    def __init__(self) -> None:
        self.admitted: LinkAdmission[LinkTransport] = LinkAdmission(max_links=8, operator_grace=0.0)
        self.encoding = Encoding()
        self.publisher = LinkPublisher(self.admitted, self.encoding)

    def link(self, role: LinkRole) -> Link:
        link = Link()
        self.admitted.add(link, Hello(role=role))
        self.publisher.link_opened(link)
        return link


def test_each_role_gets_its_own_messages() -> None:
    rig = Rig()
    rig.publisher.publish_to_operator(Status(event=1, items=[]))
    operator, events, media = rig.link("operator"), rig.link("events"), rig.link("media")
    rig.publisher.publish_feedback(feedback(1))
    rig.publisher.publish_to_operator(Status(event=1, items=[]))
    rig.publisher.publish_map(MAP)
    rig.publisher.publish_media(PICTURE)
    assert operator.kinds() == ["feedback", "status"]
    assert events.kinds() == ["event"]
    assert media.kinds() == ["map", "media"]


def test_a_media_link_that_opens_later_gets_the_newest_map_and_no_other_link_does() -> None:
    rig = Rig()
    assert rig.link("media").kinds() == []
    rig.publisher.publish_map(MAP)
    assert rig.link("media").kinds() == ["map"]
    assert rig.link("events").kinds() == []


def test_the_second_encoding_goes_to_the_links_that_take_it_while_their_path_is_clear() -> None:
    rig = Rig()
    one, other = rig.link("media"), rig.link("media")
    assert not rig.publisher.second_has_room("front"), "no link takes it"
    rig.encoding.taker = other
    assert rig.publisher.second_has_room("front")
    rig.publisher.publish_media(SECOND)
    assert (one.kinds(), other.kinds()) == ([], ["media"])
    one.pause_writing()
    assert rig.publisher.media_have_room(), "the other has"
    other.pause_writing()
    assert not rig.publisher.media_have_room()
    assert not rig.publisher.second_has_room("front")


def test_dropped_pictures_ask_for_a_keyframe() -> None:
    rig = Rig()
    rig.link("media").pause_writing()
    for _ in range(20):
        rig.publisher.publish_media(PICTURE)
    assert set(rig.encoding.needs_keyframe) == {("front", False)}


def test_without_an_encoder_dropped_pictures_ask_for_nothing_and_no_link_takes_a_second_encoding() -> None:
    rig = Rig()
    publisher = LinkPublisher(rig.admitted, None)
    link = rig.link("media")
    publisher.publish_media(SECOND)
    link.pause_writing()
    for _ in range(20):
        publisher.publish_media(PICTURE)
    assert link.kinds() == []
    assert not publisher.second_has_room("front")
