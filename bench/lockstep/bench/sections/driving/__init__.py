"""What an operator's commands take."""
