from lockstep.bench.soak.calm import Calm


def test_it_is_calm_when_the_last_trouble_has_ended() -> None:
    calm = Calm()
    before = calm.seconds()
    assert before >= 0
    with calm.trouble():
        with calm.trouble():
            assert calm.seconds() == 0
        assert calm.seconds() == 0
    assert 0 <= calm.seconds() < 60
