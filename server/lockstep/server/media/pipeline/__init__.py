"""The way of a picture or sound from its source to its subscribers."""
