from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.packets import Kind
from lockstep.emulator.impairment.profile import Profile, load_profile
from lockstep.emulator.network_statistics import collect
from lockstep.emulator.transport.client_paths import KEPT, ClientPaths, SignallingPaths

BURSTY, NARROW = load_profile("bursty-loss"), load_profile("narrow-uplink")


def client(seed: str, profile: Profile = BURSTY) -> ClientPaths:
    return ClientPaths(profile, seed, Outages())


def fates(paths: ClientPaths, kind: Kind, count: int = 300) -> list[bool]:
    return [paths.admit(kind, "to_robot", number * 0.01, 100) is None for number in range(count)]


def test_a_seed_repeats_and_clients_and_kinds_and_directions_differ() -> None:
    assert fates(client("1 client 1"), "control") == fates(client("1 client 1"), "control")
    assert fates(client("1 client 1"), "control") != fates(client("1 client 2"), "control")
    assert fates(client("1 client 1"), "control") != fates(client("1 client 1"), "media")
    back = client("1 client 1")
    assert fates(back, "control") != [back.admit("control", "to_operator", 9 + n, 100) is None for n in range(300)]


def test_how_many_checks_ice_makes_does_not_change_what_happens_to_commands() -> None:
    checked = client("1 client 1")
    fates(checked, "stun", 77)
    assert fates(checked, "control") == fates(client("1 client 1"), "control")


def test_media_and_control_share_the_bottleneck_of_their_direction() -> None:
    paths = client("1", NARROW)
    for _ in range(10):
        paths.admit("media", "to_operator", 0.0, 1172)
    arrives = paths.admit("control", "to_operator", 0.0, 100)
    assert arrives is not None
    assert arrives > 10 * 1200 * 8 / 512_000
    other = paths.admit("control", "to_robot", 0.0, 100)
    assert other is not None
    assert other < 0.03


def test_the_first_packet_starts_the_schedule_of_outages_and_later_ones_do_not() -> None:
    outages = Outages(load_profile("wifi-handover").client_outages)
    paths = ClientPaths(load_profile("wifi-handover"), "1", outages)
    paths.admit("stun", "to_robot", 100.0, 100)
    paths.admit("stun", "to_robot", 101.0, 100)
    assert outages.at(108.5) is not None
    assert paths.admit("control", "to_robot", 108.5, 100) is None


def test_http_waits_at_a_bottleneck_of_its_own() -> None:
    paths = SignallingPaths(NARROW, "1", Outages()).of("a")
    assert paths["to_operator"].admit(0.0, 64_000) > 1.0
    assert paths["to_operator"].admit(0.0, 64_000) > 2.0
    assert paths["to_robot"].admit(0.0, 100) < 0.03


def test_connections_of_http_do_not_wait_for_each_other_and_are_counted_together() -> None:
    paths = SignallingPaths(BURSTY, "1", Outages())
    first = [paths.of("a")["to_robot"].admit(0.0, 100) for _ in range(100)]
    assert max(first) > 0.1, "a lost message held up what came behind it"
    assert min(paths.of(number)["to_robot"].admit(0.0, 100) for number in range(10)) == 0.05
    assert paths.of("a") is paths.of("a")
    assert paths.statistics["to_robot"].offered == 110


def test_only_so_many_connections_are_remembered() -> None:
    paths = SignallingPaths(BURSTY, "1", Outages())
    first = paths.of("a")
    for number in range(KEPT):
        paths.of(number)
    assert paths.of("a") is not first


def test_statistics_of_all_clients_add_up() -> None:
    clients = [client("1", NARROW), client("2", NARROW)]
    for number, each in enumerate(clients):
        for _ in range(100 * (number + 1)):
            each.admit("media", "to_operator", 0.0, 972)
    found = collect(clients, {}, {}, 0.0)
    assert found.clients == 2
    assert found.paths["media"]["to_operator"].offered == 300
    queue = found.queues["to_operator"]
    assert queue.passed + queue.dropped == 300
    assert queue.dropped == found.paths["media"]["to_operator"].queue_dropped > 0
    assert 0 < queue.mean < queue.longest <= 1.0
    assert queue.now > 0.9
    fields = found.fields()
    assert isinstance(fields["paths"], dict)
    assert fields["paths"]["media"]["to_operator"]["mean_delay"] > 0
