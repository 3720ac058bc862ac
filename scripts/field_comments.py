"""For the API reference: the comments behind a class's fields become a list of its attributes."""

import ast

from griffe import Class, Docstring, Extension

__all__ = ["FieldComments"]


class FieldComments(Extension):  # type: ignore[misc]
    """An extension of Griffe, which reads the sources without importing them."""

    def on_class_members(self, *, node: ast.AST, cls: Class, **others: object) -> None:
        fields = [each for each in getattr(node, "body", ()) if isinstance(each, ast.AnnAssign)]
        source = cls.lines_collection[cls.filepath]
        lines = []
        for field in fields:
            comment = source[(field.end_lineno or 0) - 1][field.end_col_offset or 0 :].partition("#")[2].strip()
            if comment and isinstance(field.target, ast.Name):
                lines.append(f"    {field.target.id}: {comment}")
        if lines:
            about = cls.docstring.value if cls.docstring is not None else ""
            cls.docstring = Docstring("\n".join([about, "", "Attributes:", *lines]), parent=cls)
