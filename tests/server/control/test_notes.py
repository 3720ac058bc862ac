import itertools
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import SharedNote
from lockstep.server.control.notes import BOARD_BURST, BURST, KEPT, LINK_RATE, SESSION_GAP, NoteBoard
from lockstep.server.util.display_names import MAX_NAME, clean_name, printable, unique_names


def _write(
    board: NoteBoard, text: str = "hello", link: str = "l", now: float = 0.0, peer: str = "a"
) -> SharedNote | str:
    return board.write(link, peer, "Ada", "observer", text, "e1", 7, now, 1000.0004)


def test_a_note_keeps_who_when_and_at_which_event() -> None:
    note = _write(NoteBoard(), " mind\tthe \x00step\n")
    assert note == SharedNote(
        id=1, peer="a", name="Ada", role="observer", text="mind the step", epoch="e1", event=7, time=1000.0
    )


@pytest.mark.parametrize("text", ["", "\x00", " \n\t ", "\u202e\u200b"])
def test_nothing_that_can_be_printed_is_no_note(text: str) -> None:
    board = NoteBoard()
    assert _write(board, text) == "malformed"
    assert list(board) == []


def test_a_link_that_writes_too_often_is_refused_and_others_are_not() -> None:
    board = NoteBoard()
    for _ in range(int(BURST)):
        assert isinstance(_write(board), SharedNote)
    assert _write(board) == "too_often"
    assert isinstance(_write(board, link="b"), SharedNote)
    assert isinstance(_write(board, now=1 / LINK_RATE), SharedNote)


def test_all_together_are_limited_too() -> None:
    board = NoteBoard()
    results = [_write(board, link=str(number)) for number in range(int(BOARD_BURST) + 5)]
    assert results.count("too_often") == 5


def test_the_last_hundred_are_kept() -> None:
    board = NoteBoard()
    for number in range(KEPT + 10):
        assert isinstance(_write(board, f"note {number}", now=number * 10.0), SharedNote)
    assert [note.text for note in board] == [f"note {number}" for number in range(10, KEPT + 10)]


def test_further_connections_of_a_link_write_no_more_than_one() -> None:
    board = NoteBoard()
    results = [_write(board, peer=str(number)) for number in range(2 * BURST)]
    assert results.count("too_often") == BURST
    assert isinstance(_write(board, link="another"), SharedNote)


@pytest.mark.parametrize(
    ("wanted", "shown"),
    [
        ("Ada", "Ada"),
        ("  Ada \n Lovelace\t", "Ada Lovelace"),
        ("A\u202eda\x00\u200b", "Ada"),
        ("", "operator"),
        ("\x07", "operator"),
        ("x" * 100, "x" * MAX_NAME),
        ("Å" * 3, "ÅÅÅ"),
    ],
)
def test_names_are_bounded_and_can_be_printed(wanted: str, shown: str) -> None:
    assert clean_name(wanted, "operator") == shown
    assert printable(shown) == shown


def test_nobody_has_the_name_of_another() -> None:
    wanted = ["Ada 3", "Ada", "Grace", "ada", "Ada", "ADA", "Ada 2"]
    names = unique_names([(each, "") for each in wanted])
    assert names == ["Ada 3", "Ada", "Grace", "ada 2", "Ada 4", "ADA 5", "Ada 2 2"]
    assert unique_names(list(zip(wanted, names, strict=True))) == names, "and keeps it"


def test_nobody_takes_a_name_from_who_has_it() -> None:
    assert unique_names([("Ada", "Grace"), ("Ada", "Ada")]) == ["Ada 2", "Ada"]
    assert unique_names([("Ada", "Grace"), ("Ada", "Ada 2")]) == ["Ada 2", "Ada"]


def test_who_leaves_makes_room_for_one_and_the_others_keep_their_numbers() -> None:
    crowd = [("Ada", "Ada 2"), ("Ada", "Ada 3"), ("Ada", "Ada 4"), ("Ada", "")]
    assert unique_names(crowd) == ["Ada", "Ada 3", "Ada 4", "Ada 2"]


@given(st.lists(st.tuples(st.sampled_from(["Ada", "ada", "Ada 2", "B"]), st.sampled_from(["", "Ada", "Ada 2", "B"]))))
def test_no_two_are_ever_called_the_same(people: list[tuple[str, str]]) -> None:
    names = unique_names(people)
    assert len({name.casefold() for name in names}) == len(people)
    for name, (wanted, _) in zip(names, people, strict=True):
        assert name == wanted or name.rpartition(" ")[0].casefold() == wanted.casefold()


@pytest.mark.parametrize(
    ("wanted", "shown"),
    [
        ("Ada\u3164", "Ada"),  # letters that show nothing
        ("\u2800\uffa0", "operator"),
        ("Ada\ufe0f\u034f", "Ada"),
        ("e\u0301", "\u00e9"),
        ("A" + "\u0335" * 30 + "b", "A" + "\u0335" * 4 + "b"),  # drawn over the lines around it
    ],
)
def test_what_nobody_sees_is_in_no_name_and_marks_are_few(wanted: str, shown: str) -> None:
    assert clean_name(wanted, "operator") == shown
    assert printable(shown) == shown


def test_nobody_has_a_name_that_looks_like_that_of_another() -> None:
    assert unique_names([("Ada", ""), ("\uff21da", "")]) == ["Ada", "\uff21da 2"]


@pytest.mark.parametrize(
    ("name", "alike"),
    [
        ("Ada", "\u0410d\u0430"),  # Cyrillic
        ("ADA", "\u0391D\u0391"),  # Greek
        ("Ian", "lan"),
        ("Bo", "B0"),
        ("supervisor", "\u0455u\u0440\u0435rvi\u0455\u043er"),
        ("\u041d\u043e\u0440\u0430", "Hopa"),  # the other way round
        ("Ada 2", "Ad\u0430 2"),
    ],
)
def test_a_name_of_letters_that_look_like_those_of_another_gets_a_number(name: str, alike: str) -> None:
    assert unique_names([(name, ""), (alike, "")]) == [name, f"{alike} 2"]
    assert unique_names([(alike, "Grace"), (name, name)]) == [f"{alike} 2", name], "also who takes it later"


def test_names_that_look_different_are_left_as_they_are() -> None:
    names = ["Kai", "Kal", "Anna", "\u0418\u0432\u0430\u043d", "\u0413\u0440\u0435\u0442\u0430", "Bob 10"]
    assert unique_names([(each, "") for each in names]) == names


def test_a_crowd_of_names_that_look_alike_is_counted_as_one() -> None:
    spellings = ["".join(letters) for letters in itertools.product("Il1", "Oo0", "a\u0430", "p\u0440", "e\u0435")]
    names = unique_names([(each, "") for each in spellings])
    numbers = sorted(int(name.rpartition(" ")[2]) for name in names if " " in name)
    assert len(set(numbers)) == len(numbers)
    assert max(numbers) <= len(spellings)


def test_newcomers_do_not_get_the_notes_of_a_session_that_is_over_and_whoever_comes_back_soon_does() -> None:
    board = NoteBoard()
    _write(board, "the code of the door is 4711")
    board.left_empty(100.0)
    board.joined(100.0 + SESSION_GAP - 1)
    assert [note.text for note in board] == ["the code of the door is 4711"]
    board.left_empty(2000.0)
    board.joined(2000.0 + SESSION_GAP)
    assert list(board) == []
    assert cast(SharedNote, _write(board, "hello", now=3000.0)).id == 2
    board.joined(1e9)
    assert [note.text for note in board] == ["hello"]
