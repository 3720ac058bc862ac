"""Who goes when too many connections wait to be admitted."""

from lockstep.robot_bridge.link.admission.applicants import Applicants, Strangers


def test_the_busiest_address_loses_its_oldest() -> None:
    applicants: Applicants[int] = Applicants(3)
    assert [applicants.add(1, "console"), applicants.add(2, "other"), applicants.add(3, "other")] == [None] * 3
    assert [applicants.add(number, "other") for number in range(4, 100)] == list(range(2, 98))
    assert 1 in applicants
    assert len(applicants) == 3


def test_addresses_of_one_network_count_together() -> None:
    applicants: Applicants[int] = Applicants(2)
    applicants.add(1, "2001:db8::1")
    applicants.add(2, "2001:db8:0:0:ffff::2")
    assert applicants.add(3, "192.0.2.7") == 1


def test_who_is_admitted_makes_room() -> None:
    applicants: Applicants[int] = Applicants(1)
    applicants.add(1, "a")
    applicants.remove(1)
    applicants.remove(1)
    assert applicants.add(2, "a") is None


def test_silent_connections_push_out_none_that_owes_the_proof() -> None:
    strangers: Strangers[str] = Strangers(1)
    assert strangers.silent("console", "192.0.2.1") is None
    assert strangers.challenged("console", "192.0.2.1") is None
    assert strangers.silent("a", "192.0.2.2") is None
    assert strangers.silent("b", "192.0.2.3") == "a"
    assert strangers.challenged("b", "192.0.2.3") == "console"


def test_one_that_was_admitted_is_in_no_stage_any_more() -> None:
    strangers: Strangers[str] = Strangers(1)
    strangers.silent("console", "192.0.2.1")
    strangers.forget("console")
    assert strangers.challenged("console", "192.0.2.1") is None
    assert strangers.silent("a", "192.0.2.2") is None
