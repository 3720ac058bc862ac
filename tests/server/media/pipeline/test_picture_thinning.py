"""The stage that thins a camera's pictures for all tiers."""

from lockstep.server.media.pipeline.picture_thinning import PictureThinning
from tests.server.media.pipeline.collecting import Collector, Counted, arrive
from tests.server.media.viewer import picture


def test_every_second_picture_of_thirty_passes_at_fifteen_a_second() -> None:
    counted, end = Counted(), Collector()
    arrive(PictureThinning(end, 15.0, counted.dropped), *[picture(i, i / 30) for i in range(1, 31)])
    assert end.stamps == list(range(1, 31, 2))
    assert counted.drops("thinned") == 15
