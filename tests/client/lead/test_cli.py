"""The words of `lockstep drive`."""

import pytest

from lockstep.client.lead.cli import main

LINK = "http://127.0.0.1:1/#token=x"
LEADER = ("--teleop", "so101_leader", "--lerobot-python", "/none/python")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*LEADER,), "the link is missing"),
        ((LINK, "--teleop", "so101_leader"), "--lerobot-python is missing"),
        ((LINK, "--lerobot-python", "/none/python"), "--teleop TYPE is missing"),
        ((LINK, *LEADER, "--bogus"), "unrecognized: --bogus"),
        ((LINK, *LEADER, "--teleop.port", "/dev/x"), "unrecognized"),
        ((LINK, *LEADER, "--rate", "0"), "between 1 and 500"),
    ],
)
def test_what_is_missing_or_unknown_is_said(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("LOCKSTEP_LINK", raising=False)
    monkeypatch.delenv("LOCKSTEP_LEROBOT_PYTHON", raising=False)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_a_python_that_is_not_there_is_said_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main((LINK, *LEADER)) == 1
    assert capsys.readouterr().err == "lockstep drive: /none/python cannot be run: No such file or directory\n"
