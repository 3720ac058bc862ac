import pytest

from lockstep.server.media.published.camera_spec import parse_published
from lockstep.server.media.sources.source_url import BadSource
from lockstep.server.settings import Settings


def test_a_name_is_enough_and_options_are_those_of_other_cameras() -> None:
    plain, told = parse_published(["phone", "desk-2#label=The%20desk,latency=0.5,size=640x480,rate=10"])
    assert (plain.name, plain.label, plain.scheme, plain.kind, plain.latency) == (
        "phone",
        "Phone",
        "whip",
        "video",
        0.3,
    )
    assert (told.name, told.label, told.latency, told.size, told.rate) == ("desk-2", "The desk", 0.5, (640, 480), 10)
    assert not plain.passing


@pytest.mark.parametrize(
    "given", [["a b"], [""], ["2a"], ["a", "a"], ["a#latency=-1"], ["a#unknown=1"], list("abcde"), ["x" * 33]]
)
def test_what_cannot_be_meant_is_refused(given: list[str]) -> None:
    with pytest.raises(BadSource):
        parse_published(given)


def test_the_setting_names_published_cameras_and_no_two_sources_have_one_name() -> None:
    settings = Settings(cameras="door=rtsp://h/", whip="phone desk#latency=1")  # type: ignore[arg-type]
    assert [(spec.name, spec.scheme) for spec in settings.sources] == [
        *(("door", "rtsp"), ("phone", "whip"), ("desk", "whip")),
    ]
    assert Settings().whip == ()
    with pytest.raises(ValueError, match="the name phone is used twice"):
        Settings(cameras="phone=rtsp://h/", whip="phone")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="whip: more than 4"):
        Settings(whip="a b c d e")  # type: ignore[arg-type]
