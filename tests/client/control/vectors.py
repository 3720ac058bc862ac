"""The tables of cases that Python and TypeScript share."""

import json
from pathlib import Path
from typing import Any

VECTORS = Path(__file__).resolve().parents[2] / "vectors"


def load_vectors(name: str) -> Any:
    return json.loads((VECTORS / name).read_text())
