"""The age of a status grows on the console's own clock."""

from lockstep.protocol.actions import Status, StatusItem
from lockstep.server.actions.status_service import StatusService

STATUS = Status(event=3, items=[StatusItem(name="battery", label="Battery", kind="battery", value=0.5, age=0.4)])


def test_a_reading_gets_older_while_no_other_comes() -> None:
    service = StatusService()
    assert service.message(5.0) is None
    assert service.take(STATUS, 10.0)
    assert service.message(10.0) == STATUS
    later = service.message(12.5)
    assert later is not None
    assert later.items[0].age == 2.9
    early = service.message(9.0)
    assert early == STATUS, "a clock never makes it younger"
    service.forget()
    assert service.message(13.0) is None


def test_a_flood_is_kept_and_told_rarely() -> None:
    service = StatusService()
    told = [service.take(Status(event=number + 1), 10.0 + number / 1000) for number in range(500)]
    assert sum(told) < 20
    newest = service.message(11.0)
    assert newest is not None
    assert newest.event == 500
