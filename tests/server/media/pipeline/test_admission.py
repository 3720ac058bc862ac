"""The first stage of every stream."""

from lockstep.server.media.pipeline.admission import MAX_AT_ONCE, Admission
from tests.server.media.pipeline.collecting import Collector, Counted, arrive
from tests.server.media.viewer import picture


class World(Counted):
    def __init__(self) -> None:
        super().__init__()
        self.wanted = True
        self.end = Collector()
        arrived = self.metrics.frames_in.labels("camera0")
        self.stage = Admission(self.end, lambda: self.wanted, arrived, self.dropped)


def test_frames_in_order_pass_with_their_times_and_one_with_an_older_stamp_is_dropped() -> None:
    world = World()
    arrive(world.stage, picture(5, 0.0), picture(5, 0.1), picture(4, 0.2), picture(6, 0.3))
    assert world.end.stamps == [5, 5, 6]
    assert world.end.sources[-1][1:] == (0.3, 1000.3)
    assert world.drops("stale_stamp") == 1


def test_the_stamp_after_the_largest_one_is_newer() -> None:
    world = World()
    arrive(world.stage, picture(2**31 - 1, 0.0), picture(1, 0.1))
    assert world.end.stamps == [2**31 - 1, 1]


def test_h264_passes_with_an_older_stamp_too_and_while_nobody_takes_the_stream() -> None:
    world = World()
    world.wanted = False
    arrive(world.stage, picture(5, 0.0, codec="h264"), picture(4, 0.1, codec="h264"), picture(6, 0.2))
    assert world.end.stamps == [5, 4]
    assert world.drops("stale_stamp") == 0


def test_more_frames_than_any_source_makes_are_dropped() -> None:
    world = World()
    arrive(world.stage, *[picture(1, 0.0)] * (int(MAX_AT_ONCE) + 3))
    assert len(world.end.sources) == MAX_AT_ONCE
    assert world.drops("too_often") == 3


def test_the_newest_frame_is_known_even_if_nobody_takes_it() -> None:
    world = World()
    world.wanted = False
    before = world.stage.newest
    arrive(world.stage, picture(5, 0.25, width=64))
    newest = world.stage.newest
    assert before is None
    assert newest is not None
    assert (newest.media.width, newest.arrived_at) == (64, 0.25)


def test_the_size_is_that_of_the_newest_picture_that_says_it_and_was_not_dropped() -> None:
    world = World()
    arrive(world.stage, picture(5, 0.0, width=64, height=48), picture(6, 0.1, width=0), picture(2, 0.2, width=800))
    assert world.stage.size == (64, 48)
    newest = world.stage.newest
    assert newest is not None
    assert newest.media.stamp == 6


def test_a_flood_of_second_pictures_takes_nothing_from_the_first_and_breaks_the_second_alone() -> None:
    world = World()
    second, lost = Collector(), []
    arrived = world.metrics.frames_in.labels("camera0")

    class Second:
        source = second.source

        def lost(self) -> None:
            lost.append("second")

    stage = Admission(
        world.end, lambda: True, arrived, world.dropped, on_lost=lambda: lost.append("first"), second=Second()
    )
    flood = int(MAX_AT_ONCE) + 2
    arrive(stage, *[picture(1, 0.0, codec="h264", second=True)] * flood, picture(2, 0.0, codec="h264"))
    assert world.end.stamps == [2]
    assert len(second.sources) == MAX_AT_ONCE
    assert lost == ["second"] * 2
    assert world.drops("too_often") == 2


def test_a_second_encoding_of_sound_is_counted_and_goes_nowhere() -> None:
    world = World()
    arrive(world.stage, picture(1, 0.0, second=True))
    assert world.end.sources == []
    assert world.drops("not_asked") == 1
