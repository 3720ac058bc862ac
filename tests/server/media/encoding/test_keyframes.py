from lockstep.server.media.encoding.keyframes import JOIN_BURST, MOST_SPACING, OTHERS_SPACING, KeyframeScheduler

FPS = 30


def taken(scheduler: KeyframeScheduler, start: float, pictures: int) -> list[int]:
    """Which of the next pictures are keyframes."""
    return [i for i in range(pictures) if scheduler.take(start + i / FPS)]


def test_the_first_picture_is_a_keyframe() -> None:
    assert taken(KeyframeScheduler(10, 0.3), 5.0, 3) == [0]


def test_a_keyframe_comes_after_the_interval_without_being_asked_for() -> None:
    assert taken(KeyframeScheduler(1.0, 0.3), 0.0, 65) == [0, 30, 60]


def test_a_joining_peer_is_served_with_the_next_picture() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.take(0.0)
    scheduler.join()
    assert scheduler.take(0.01)
    assert not scheduler.take(0.02)


def test_requests_within_the_spacing_are_merged_into_one_later_keyframe() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.take(0.0)
    for _ in range(100):
        scheduler.request()
    assert taken(scheduler, 1 / FPS, 20) == [8]


def test_a_storm_of_joins_is_served_at_once_for_a_burst_and_then_spaced() -> None:
    scheduler = KeyframeScheduler(100, 0.3)
    scheduler.take(0.0)
    served = 0
    for i in range(90):  # 3 s in which somebody joins before every picture
        scheduler.join()
        served += scheduler.take((i + 1) / FPS)
    assert JOIN_BURST < served <= JOIN_BURST + 3 / 0.3 + 10
    scheduler.join()
    assert any(scheduler.take(3 + i / FPS) for i in range(10))  # nobody is forgotten


def test_a_lone_join_after_a_storm_is_served_at_once_again() -> None:
    scheduler = KeyframeScheduler(100, 0.3)
    for i in range(60):
        scheduler.join()
        scheduler.take(i / FPS)
    scheduler.request()
    assert scheduler.take(8.0)
    scheduler.join()
    assert scheduler.take(8.01)


def test_without_spacing_every_request_is_served() -> None:
    scheduler = KeyframeScheduler(100, 0.0)
    scheduler.take(0.0)
    for i in range(5):
        scheduler.request()
        assert scheduler.take(i / FPS)


def test_requests_that_keep_coming_are_served_more_and_more_rarely() -> None:
    scheduler = KeyframeScheduler(1000, 0.3)
    scheduler.take(0.0)
    keyframes = []
    for i in range(1, 20 * FPS):
        scheduler.request()
        if scheduler.take(i / FPS):
            keyframes.append(i / FPS)
    gaps = [round(later - earlier, 1) for earlier, later in zip(keyframes, keyframes[1:], strict=False)]
    assert gaps == sorted(gaps)
    assert gaps[-1] == MOST_SPACING
    scheduler.join()
    assert scheduler.take(20.5)  # who joins does not wait for that


def test_after_some_rest_requests_are_served_soon_again() -> None:
    scheduler = KeyframeScheduler(1000, 0.3)
    for i in range(20 * FPS):
        scheduler.request()
        scheduler.take(i / FPS)
    for i in range(6):
        scheduler.request()
        assert scheduler.take(30.0 + 10 * i)
    scheduler.request()
    assert any(scheduler.take(80.0 + i / FPS) for i in range(12))


def test_a_path_without_room_is_spared_keyframes_that_nobody_asked_for() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.sparing = True
    scheduler.take(0.0)
    assert taken(scheduler, 1.0, 58 * FPS) == []
    assert scheduler.take(60.0)
    scheduler.request()
    assert scheduler.take(61.0)


def test_on_a_path_without_room_others_than_the_operator_get_few_keyframes() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.sparing = True
    keyframes = []
    for i in range(60 * FPS):
        scheduler.join(other=True)
        scheduler.request(other=True)
        if scheduler.take(i / FPS):
            keyframes.append(i / FPS)
    gaps = [later - earlier for earlier, later in zip(keyframes, keyframes[1:], strict=False)]
    assert min(gaps) >= OTHERS_SPACING
    assert len(keyframes) == 12  # nobody is forgotten


def test_the_operator_waits_for_nothing_that_others_asked_for() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.sparing = True
    for i in range(20 * FPS):
        scheduler.join(other=True)
        scheduler.request(other=True)
        scheduler.take(i / FPS)
    scheduler.take(20.0)
    scheduler.request()
    assert taken(scheduler, 20.0 + 1 / FPS, 12) == [8]
    scheduler.join()
    assert scheduler.take(20.5)


def test_on_a_path_with_room_others_are_served_like_the_operator() -> None:
    scheduler = KeyframeScheduler(10, 0.3)
    scheduler.take(0.0)
    scheduler.request(other=True)
    assert taken(scheduler, 1 / FPS, 12) == [8]
    scheduler.join(other=True)
    assert scheduler.take(0.5)
