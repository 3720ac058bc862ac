from lockstep.bench.emulator_delay import measure


async def test_no_packet_is_lost_and_none_is_early() -> None:
    found = await measure(2, 0.5)
    assert found["packets"] == 300
    assert found["lost"] == 0
    assert found["late_ms"]["least"] > 0
