"""From a graph to the text of a robot's file: no I/O besides the questions."""
