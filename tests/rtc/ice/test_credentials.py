import pytest

from lockstep.rtc.ice.credentials import Credentials, CredentialsError, new_credentials


def test_new_credentials_are_valid_and_never_the_same() -> None:
    made = {new_credentials() for _ in range(100)}
    assert len({each.ufrag for each in made}) == len({each.password for each in made}) == 100


def test_the_password_is_not_shown() -> None:
    credentials = new_credentials()
    assert credentials.password not in repr(credentials)


@pytest.mark.parametrize(
    ("ufrag", "password"),
    [
        ("abc", "x" * 22),
        ("a" * 257, "x" * 22),
        ("abcd", "x" * 21),
        ("abcd", "x" * 257),
        ("ab:d", "x" * 22),
        ("abcd", "x" * 22 + " "),
        ("abcd\n", "x" * 22),
    ],
)
def test_what_the_grammar_does_not_allow_is_refused_by_name(ufrag: str, password: str) -> None:
    with pytest.raises(CredentialsError):
        Credentials(ufrag, password)
