"""Which picture is encoded next, and for which tier."""

from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.encoding.picture_encoding import PictureQueue
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.stage import SourceFrame
from tests.server.media.pipeline.collecting import Counted
from tests.server.media.viewer import picture


class World(Counted):
    def __init__(self, *tiers: str) -> None:
        super().__init__()
        self.all = self.encodings("H264")
        for tier in tiers:
            self.all.join("H264", self.subscription(), tier)  # type: ignore[arg-type]
        taken = self.metrics.taken.labels("camera0")
        self.group = GroupOfPictures()
        self.queue = PictureQueue(self.all, 30.0, PictureClock(), self.group, taken, self.dropped)

    def put(self, stamp: int) -> None:
        self.queue.put(SourceFrame(picture(stamp, stamp / 30), stamp / 30, 1000 + stamp / 30))

    def next(self) -> tuple[int, str] | None:
        job = self.queue.next_job()
        return None if job is None else (job.media.stamp, job.encoding.tier)


def test_the_operators_tier_comes_first_and_each_picture_serves_all_tiers_while_there_is_time() -> None:
    world = World("low", "high", "operator")
    world.put(1)
    assert [world.next() for _ in range(4)] == [(1, "operator"), (1, "low"), (1, "high"), None]


def test_a_newer_picture_takes_the_place_of_one_that_waits() -> None:
    world = World("operator")
    world.put(1)
    world.put(2)
    assert [world.next(), world.next()] == [(2, "operator"), None]
    assert world.drops("encoder_busy") == 1


def test_when_the_encoders_are_too_slow_the_tier_that_waited_longest_comes_next() -> None:
    world = World("low", "high", "operator")
    world.put(1)
    made = [world.next(), world.next()]
    world.put(2)
    made += [world.next(), world.next()]
    world.put(3)
    made += [world.next(), world.next()]
    assert made == [(1, "operator"), (1, "low"), (2, "operator"), (2, "high"), (3, "operator"), (3, "low")]
    assert world.drops("encoder_busy") == 2


def test_no_picture_is_encoded_for_a_tier_whose_path_is_busy() -> None:
    world = World("operator")
    world.all.own.get("H264", "operator").paused_until = 1.0
    world.put(1)
    assert world.next() is None
    assert world.drops("path_busy") == 1
    world.put(31)
    assert world.next() == (31, "operator")


def test_an_encoding_that_everybody_has_left_meanwhile_is_not_made() -> None:
    world = World("operator", "low")
    world.put(1)
    assert world.next() == (1, "operator")
    low = world.all.own.get("H264", "low")
    for target in list(low.targets):
        world.all.leave(target)
    assert world.next() is None


def test_pictures_that_build_on_each_other_are_taken_with_the_job_that_decodes_them() -> None:
    world = World("operator")
    (target,) = world.all.own.get("H264", "operator").targets

    def put(stamp: int) -> None:
        media = picture(stamp, stamp / 30, codec="h264", keyframe=stamp == 1)
        world.group.add(media)
        world.queue.put(SourceFrame(media, stamp / 30, 1000 + stamp / 30))

    put(1)
    put(2)
    world.all.leave(target)
    assert world.next() is None, "nobody wants it any more"
    world.all.join("H264", target)
    put(3)
    job = world.queue.next_job()
    assert job is not None
    assert [each.stamp for each in job.source.group] == [1, 2, 3]
    put(4)
    world.group.add(picture(5, 5 / 30, codec="h264", keyframe=False))  # which nobody needs from here
    job = world.queue.next_job()
    assert job is not None
    assert [each.stamp for each in job.source.group] == [4], "5 would be shown with the stamp of 4"
    put(6)
    world.group.add(picture(7, 7 / 30, codec="h264", keyframe=True))
    assert world.next() is None, "it cannot be decoded any more, and a newer one comes"
    assert world.drops("no_reference") == 1
