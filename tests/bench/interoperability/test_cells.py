"""Which cells are run, what counts as working, and how the table reads."""

import pytest

from lockstep.bench.interoperability.cells import CELLS, Cell, Found, seconds_of, table_of, wanted

WORKS = Found(seconds=60, pictures=900, events=40)


def test_every_client_has_twenty_minutes_of_udp_and_a_minute_of_each_other_way_that_it_can_take() -> None:
    assert {cell.client for cell in CELLS if cell.way == "udp"} == {cell.client for cell in CELLS}
    assert {seconds_of(cell) for cell in CELLS if cell.way == "udp"} == {1200.0}
    assert {seconds_of(cell) for cell in CELLS if cell.way != "udp"} == {60.0}
    assert Cell("aiortc", "tcp") not in CELLS


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (WORKS, "ok"),
        (Found(seconds=60, pictures=100, events=40), "only 100 pictures"),
        (Found(seconds=60, pictures=900), "no feedback"),
        (Found(seconds=60, pictures=900, events=40, violations=2), "2 beyond the tolerance"),
        (Found(seconds=60, pictures=900, events=40, reconnections=1), "1 reconnections"),
        (Found(seconds=60, trouble="it did not connect"), "it did not connect"),
    ],
)
def test_a_cell_works_only_when_pictures_and_feedback_came_without_a_break(found: Found, verdict: str) -> None:
    assert found.verdict == verdict


def test_a_run_goes_on_with_what_was_not_run_or_did_not_work() -> None:
    known = {"chromium udp": WORKS, "firefox udp": Found(seconds=60, trouble="lost")}
    udp = wanted(known, ways=["udp"])
    assert Cell("chromium", "udp") not in udp
    assert Cell("firefox", "udp") in udp
    assert Cell("aiortc", "udp") in udp
    assert wanted(known, clients=["chromium"], ways=["udp"], again=True) == [Cell("chromium", "udp")]
    assert len(wanted({})) == len(CELLS)


def test_the_table_says_of_each_cell_what_was_found_or_that_there_is_none() -> None:
    table = table_of({"chromium udp": WORKS, "firefox far": Found(seconds=60, trouble="lost")})
    rows = {line.split("|")[1].strip(): line for line in table.splitlines()}
    assert "ok (60 s, 900 pictures)" in rows["chromium"]
    assert "lost (60 s, 0 pictures)" in rows["firefox"]
    assert "–" in rows["aiortc"]
    assert "not run" in rows["headless"]
