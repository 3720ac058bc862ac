"""The trial of the encoder of the settings at the bridge's start."""

import threading

from lockstep.robot_bridge.encoding.encoder_choice import SOFTWARE
from lockstep.robot_bridge.encoding.encoder_trial import try_in_time


async def test_an_encoder_that_hangs_is_given_up_and_its_thread_keeps_no_bridge_from_ending() -> None:
    hangs, threads = threading.Event(), list[threading.Thread]()

    def hang(name: str) -> str:
        threads.append(threading.current_thread())
        hangs.wait()
        return ""

    try:
        why = await try_in_time("h264_v4l2m2m", 0.02, hang)
        assert why == "h264_v4l2m2m cannot be used: it gave no picture within 0.02 s"
        assert all(thread.daemon for thread in threads)
    finally:
        hangs.set()
    for thread in threads:
        thread.join()


async def test_an_error_that_nobody_expected_is_a_reason_and_does_not_end_the_bridge() -> None:
    def fail(name: str) -> str:
        raise MemoryError("no buffers")

    assert "no buffers" in await try_in_time("h264_nvenc", trial=fail)


async def test_an_encoder_that_works_is_used_and_one_that_is_missing_says_why() -> None:
    assert await try_in_time(SOFTWARE) == ""
    assert "h264_missing" in await try_in_time("h264_missing")  # no hardware has it, whatever machine runs this
