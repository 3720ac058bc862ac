"""The arithmetic of docs/scale.md."""

from dataclasses import replace

from lockstep.bench.relay.capacity import Figures, plan, render

FIGURES = Figures(
    bits_per_second=1e6,
    packets_per_second=100,
    direct_share=0.5,
    member_share=0.05,
    relay_microseconds=10,
    hop_milliseconds=2,
    network_bits=1e9,
    usable=1.0,
    console_share=50.0,
)


def test_a_few_observers_need_no_relay() -> None:
    found = plan(100, FIGURES)
    assert (found.relays, found.hops, found.added_milliseconds) == (0, 0, 0)
    assert found.console_bits == 100e6


def test_one_more_than_the_console_serves_needs_one_and_the_console_sends_once() -> None:
    found = plan(101, FIGURES)
    assert (found.relays, found.hops, found.console_bits, found.first_bits) == (1, 1, 1e6, 0)


def test_the_network_is_full_before_the_processor() -> None:
    assert (plan(1000, FIGURES).per_relay, plan(1000, FIGURES).limit) == (1000, "network")
    slow = replace(FIGURES, relay_microseconds=20)
    assert (plan(1000, slow).per_relay, plan(1000, slow).limit) == (500, "processor")


def test_the_first_relay_feeds_the_others_besides_its_observers() -> None:
    found = plan(10_000, FIGURES)
    assert (found.relays, found.hops, found.added_milliseconds) == (11, 2, 4)
    assert found.first_bits == 10e6


def test_the_table_says_when_not_all_can_be_participants() -> None:
    assert "only 1000 of them" in render([plan(100_000, FIGURES)])
    assert "only" not in render([plan(10, FIGURES)])
