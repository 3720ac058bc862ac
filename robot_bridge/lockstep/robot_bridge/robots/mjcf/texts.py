"""Reads settings for Lockstep in a model: `<custom><text name="lockstep_…" data="…"/></custom>`."""

from typing import Any

import mujoco

__all__ = ["words_of"]


def words_of(model: Any, text: str) -> list[str]:
    """Return the words of a text of the model; none if the model has no such text."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, text)
    if number < 0:
        return []
    begin, size = int(model.text_adr[number]), int(model.text_size[number])
    return bytes(model.text_data)[begin : begin + size].rstrip(b"\0").decode(errors="replace").split()
