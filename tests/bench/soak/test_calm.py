from lockstep.bench.soak.calm import Calm


def test_it_is_calm_from_the_end_of_the_last_trouble() -> None:
    now = 100.0
    calm = Calm(lambda: now)
    now = 107.0
    assert calm.seconds() == 7.0
    with calm.trouble():
        with calm.trouble():
            now = 109.0
            assert calm.seconds() == 0
        now = 112.0
        assert calm.seconds() == 0
    assert calm.seconds() == 0, "calm begins anew"
    now = 115.0
    assert calm.seconds() == 3.0
