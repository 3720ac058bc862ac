"""For the API reference: the comment at the end of a field's line is the field's documentation."""

import ast

from griffe import Attribute, Docstring, Extension

__all__ = ["FieldComments"]


class FieldComments(Extension):  # type: ignore[misc]
    """An extension of Griffe, which reads the sources without importing them."""

    def on_attribute_instance(self, *, node: ast.AST, attr: Attribute, **others: object) -> None:
        if attr.docstring is not None or attr.parent is None or not attr.parent.is_class:
            return
        last = getattr(node, "end_lineno", None)
        if not isinstance(node, ast.AnnAssign) or last is None:
            return
        _, mark, comment = attr.lines_collection[attr.filepath][last - 1][node.end_col_offset :].partition("#")
        if mark:
            attr.docstring = Docstring(comment.strip(), lineno=last, endlineno=last, parent=attr)
