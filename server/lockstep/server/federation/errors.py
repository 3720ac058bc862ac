"""Errors between this console and others.

BoardError
├── BoardUnusable       the settings ask for a board that cannot work here
├── BoardTrouble        the store does not work
│   ├── BoardUnreachable    no connection, or it ended
│   ├── BoardSilent         no answer in time
│   ├── BoardRefused        it refuses the login, or a command
│   ├── BoardFull           it is full, or read-only
│   └── BoardWrongType      a key of the consoles holds another type of value
└── BoardInput          a value in the store is not one that a console writes
    ├── InputTooLarge
    ├── InputNotSealed      not sealed with this console's signing key
    └── InputMalformed
"""

__all__ = [
    "BoardError",
    "BoardFull",
    "BoardInput",
    "BoardRefused",
    "BoardSilent",
    "BoardTrouble",
    "BoardUnreachable",
    "BoardUnusable",
    "BoardWrongType",
    "InputMalformed",
    "InputNotSealed",
    "InputTooLarge",
]


class BoardError(Exception):
    """Base of all errors of the board.

    Attributes:
        name: stable identifier for logs and metrics
        detail: for a person; never holds a secret
    """

    name = "board"

    def __init__(self, detail: str = "") -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}" if self.detail else self.name


class BoardUnusable(BoardError):
    name = "unusable"

    def __str__(self) -> str:
        return f"board: {self.detail}"


class BoardTrouble(BoardError):
    name = "trouble"


class BoardUnreachable(BoardTrouble):
    name = "unreachable"


class BoardSilent(BoardTrouble):
    name = "silent"


class BoardRefused(BoardTrouble):
    name = "refused"


class BoardFull(BoardTrouble):
    name = "full"


class BoardWrongType(BoardTrouble):
    name = "wrong_type"


class BoardInput(BoardError):
    name = "input"


class InputTooLarge(BoardInput):
    name = "too_large"


class InputNotSealed(BoardInput):
    name = "not_sealed"


class InputMalformed(BoardInput):
    name = "malformed"
