"""Tools of a model that are driven by their pose."""
