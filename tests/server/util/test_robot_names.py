import pytest

from lockstep.server.util.robot_names import BadFleet, check_robot_name, is_named, parse_robots


@pytest.mark.parametrize("name", ["a", "left", "arm-2", "0", "a" * 32])
def test_a_plain_name_is_taken(name: str) -> None:
    assert check_robot_name(name) == name


@pytest.mark.parametrize("name", ["", "-a", "A", "a b", "a/b", "..", "a" * 33, "left\n", "ä", "a.b", "a=b"])
def test_any_other_name_is_refused_by_name(name: str) -> None:
    with pytest.raises(BadFleet) as refused:
        check_robot_name(name)
    assert refused.value.name == "bad_robot_name"


def test_an_address_alone_is_no_named_robot() -> None:
    assert not is_named("tcp://127.0.0.1:5600")
    assert not is_named("tls://robot:1?a=b")
    assert is_named("left=tcp://127.0.0.1:5600")


def test_robots_keep_their_order() -> None:
    assert parse_robots(["b=tcp://h:1", "a=tcp://h:2"]) == [("b", "tcp://h:1"), ("a", "tcp://h:2")]


@pytest.mark.parametrize(
    ("texts", "name"),
    [
        (["a=tcp://h:1", "a=tcp://h:2"], "robot_named_twice"),
        (["a=tcp://h:1", "tcp://h:2"], "robot_without_name"),
        (["A=tcp://h:1"], "bad_robot_name"),
        ([f"r{number}=tcp://h:1" for number in range(65)], "too_many_robots"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(texts: list[str], name: str) -> None:
    with pytest.raises(BadFleet) as refused:
        parse_robots(texts)
    assert refused.value.name == name
    assert str(refused.value).startswith(f"{name}: ")
