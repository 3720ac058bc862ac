from lockstep.server.media.published.published_camera import PublishedCamera
from lockstep.server.media.sources.source_wire import Captured
from tests.server.media.published.publishing import camera

PICTURE = Captured("yuv420p", 1.0, b"x", 16, 16)


class Heard:
    def __init__(self) -> None:
        self.media: list[Captured] = []
        self.changes: list[tuple[str, str]] = []
        self.failures: list[str] = []
        self.camera = PublishedCamera(camera(), self.media.append, self._changed, self.failures.append)

    def _changed(self) -> None:
        self.changes.append((self.camera.state, self.camera.detail))


def test_it_says_who_publishes_and_why_nobody_does() -> None:
    heard = Heard()
    assert heard.camera.state == "waiting"
    ann = object()
    heard.camera.begin(ann)
    for _ in range(3):
        heard.camera.captured(ann, PICTURE, "Ann")
    heard.camera.failed(ann, "silent", "no data arrives")
    heard.camera.captured(ann, PICTURE, "Ann")
    heard.camera.end(ann, "deleted", "its publisher has left")
    heard.camera.end(ann, "deleted", "again")
    assert heard.changes == [
        ("connecting", ""),
        ("live", "published by Ann"),
        ("reconnecting", "no data arrives"),
        ("live", "published by Ann"),
        ("waiting", "its publisher has left"),
    ]
    assert len(heard.media) == 4
    assert heard.failures == ["silent", "deleted"]


def test_whoever_was_replaced_says_nothing_any_more() -> None:
    heard = Heard()
    first, second = object(), object()
    heard.camera.begin(first)
    heard.camera.begin(second)
    heard.camera.captured(first, PICTURE, "first")
    heard.camera.failed(first, "silent", "")
    heard.camera.end(first, "closed", "")
    assert heard.media == []
    assert (heard.camera.publisher, heard.camera.state) == (second, "connecting")
    assert heard.failures == []
