"""What the console has recorded: the files and their episodes."""
