"""Names of a model's elements, also of those without one, and labels for people."""

from typing import Any

__all__ = ["label_of", "name_of"]


def name_of(model: Any, kind: str, number: int) -> str:
    """Return the name in the model, or one made of kind and number; unique within its kind, as MuJoCo's are."""
    name: str = getattr(model, kind)(number).name
    return name or f"{kind}{number}"


def label_of(name: str) -> str:
    """Return "Shoulder pan" for "shoulder_pan"."""
    words = name.replace("/", " ").replace("_", " ").replace(".", " ").replace("-", " ").strip()
    return (words[:1].upper() + words[1:]) or name
