from lockstep.bench.figures.way_results import sum_of_spans, way_results
from lockstep.protocol.traces.trace import PICTURE_WAY


def test_the_rows_add_up_to_a_usual_way() -> None:
    traced = [{"encode_ms": encode, "draw_ms": 1.0} for encode in (0.0, 2.0, 4.0, 100.0)]
    rows = way_results("traces", "planar: picture", PICTURE_WAY, traced)
    assert [(row.name, row.value, row.stacked_on) for row in rows] == [
        ("planar: picture: console, encode", 3.0, 0.0),
        ("planar: picture: page, draw", 1.0, 3.0),
    ]
    assert sum_of_spans(rows) == 4.0
    assert {row.samples for row in rows} == {4}


def test_nothing_traced_makes_no_rows() -> None:
    assert way_results("traces", "planar: picture", PICTURE_WAY, []) == []
