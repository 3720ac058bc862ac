"""What can go wrong between this console and the others.

BoardError
├── BoardUnusable       the settings ask for what cannot be had here
├── BoardTrouble        the store does not do its part
│   ├── BoardUnreachable    no connection, or it ended
│   ├── BoardSilent         no answer in time
│   ├── BoardRefused        it does not let us in, or forbids a command
│   ├── BoardFull           it takes no more, or only reads
│   └── BoardWrongType      somebody keeps something else at a key of ours
└── BoardInput          something in the store is not what a console writes
    ├── InputTooLarge
    ├── InputNotSealed      not sealed by our signing key
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
