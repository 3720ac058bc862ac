"""Which links are admitted."""

from lockstep.protocol.messages import Goodbye, Hello, LinkRole
from lockstep.robot_bridge.link.admission.link_admission import LinkAdmission

GRACE = 10.0  # s


def hello(role: LinkRole, name: str = "console") -> Hello:
    return Hello(role=role, name=name)


def admitted(*links: tuple[str, LinkRole], max_links: int = 4) -> LinkAdmission[str]:
    admission: LinkAdmission[str] = LinkAdmission(max_links=max_links, operator_grace=GRACE)
    for link, role in links:
        assert admission.refuses(hello(role), 0.0) is None
        admission.add(link, hello(role))
    return admission


def error(refused: Goodbye | None) -> str:
    return "" if refused is None else refused.error


def test_there_is_one_operator_link() -> None:
    admission = admitted(("first", "operator"))
    assert error(admission.refuses(hello("operator"), 0.0)) == "taken"
    assert admission.remove("first", "console", 0.0, left=True)
    assert admission.refuses(hello("operator"), 0.0) is None


def test_the_last_place_is_the_operators() -> None:
    admission = admitted(("a", "events"), ("b", "media"), max_links=3)
    assert error(admission.refuses(hello("events"), 0.0)) == "full"
    assert admission.refuses(hello("operator"), 0.0) is None
    admission.add("c", hello("operator"))
    assert not admission.remove("a", "", 0.0, left=False)
    assert admission.refuses(hello("media"), 0.0) is None


def test_a_broken_operator_link_is_kept_for_its_client_during_the_grace() -> None:
    admission = admitted(("first", "operator"))
    admission.remove("first", "console", 100.0, left=False)
    assert error(admission.refuses(hello("operator", "another"), 100.0 + GRACE - 0.1)) == "taken"
    assert admission.refuses(hello("operator"), 100.1) is None
    assert admission.refuses(hello("operator", "another"), 100.0 + GRACE) is None


def test_a_client_that_left_in_order_keeps_nothing() -> None:
    admission = admitted(("first", "operator"))
    admission.remove("first", "console", 100.0, left=True)
    assert admission.refuses(hello("operator", "another"), 100.0) is None


def test_links_are_known_by_what_they_get() -> None:
    admission = admitted(("a", "events"), ("b", "media"), ("c", "operator"))
    assert (admission.events, admission.media, admission.operator) == ({"a"}, {"b"}, "c")
