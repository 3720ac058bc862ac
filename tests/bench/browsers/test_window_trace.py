"""The time at which a picture reached the window, from trace events like Chromium's."""

from typing import Any

import pytest

from lockstep.bench.browsers.window_trace import OWN_SURFACE, read_trace

pytestmark = pytest.mark.fast

PAGE, CAMERA, SMALL = 2, OWN_SURFACE + 2, OWN_SURFACE + 3


def _step(step: str, at_ms: float, **more: Any) -> dict[str, Any]:
    return {"ph": "X", "ts": at_ms * 1000, "args": {"chrome_graphics_pipeline": {"step": step, **more}}}


def _frame(at_ms: float, sink: int) -> dict[str, Any]:
    return _step("STEP_RECEIVE_COMPOSITOR_FRAME", at_ms, frame_sink_id={"frame_sink_id": sink})


def _swap(number: int, began_ms: float, ended_ms: float) -> list[dict[str, Any]]:
    return [
        _step("STEP_SURFACE_AGGREGATION", began_ms, display_trace_id=number),
        _step("STEP_FINISH_BUFFER_SWAP", ended_ms, display_trace_id=number),
    ]


def test_a_picture_is_shown_by_the_first_swap_that_begins_after_its_frame_came() -> None:
    trace = read_trace([_frame(10, PAGE), *_swap(1, 9, 11), *_swap(2, 12, 14), *_swap(3, 20, 21)])
    assert trace.shown_by_page(0.008) == pytest.approx(0.014)


def test_frames_of_a_surface_of_its_own_and_of_the_page_are_told_apart() -> None:
    trace = read_trace([_frame(10, CAMERA), _frame(30, PAGE), *_swap(1, 11, 12), *_swap(2, 31, 33)])
    assert trace.shown_by_surface(0.009) == pytest.approx(0.012)
    assert trace.shown_by_page(0.009) == pytest.approx(0.033)


def test_the_measured_surface_is_that_with_the_most_frames() -> None:
    frames = [_frame(10, SMALL), _frame(20, CAMERA), _frame(40, CAMERA)]
    trace = read_trace([*frames, *_swap(1, 11, 12), *_swap(2, 21, 22), *_swap(3, 41, 42)])
    assert trace.shown_by_surface(0.005) == pytest.approx(0.022)


def test_a_picture_whose_swap_is_not_in_the_trace_was_not_shown() -> None:
    trace = read_trace([_frame(10, CAMERA), *_swap(1, 5, 6), {"ph": "M", "name": "thread_name", "args": {}}])
    assert trace.shown_by_surface(0.009) is None
    assert trace.shown_by_surface(0.011) is None
    assert trace.shown_by_page(0.0) is None
