"""Names of things in a model that may have none, and words for people."""

from typing import Any

__all__ = ["label_of", "name_of"]


def name_of(model: Any, kind: str, number: int) -> str:
    """The name in the model, or one made of the kind and the number. Unique within its kind, as MuJoCo's are."""
    name: str = getattr(model, kind)(number).name
    return name or f"{kind}{number}"


def label_of(name: str) -> str:
    """ "shoulder_pan" as "Shoulder pan"."""
    words = name.replace("/", " ").replace("_", " ").replace(".", " ").replace("-", " ").strip()
    return (words[:1].upper() + words[1:]) or name
