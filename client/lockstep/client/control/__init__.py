"""The operator's side of the command loop: pacing, repeats, rests and outcomes of commands."""
