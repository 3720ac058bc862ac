"""The path of pictures and sound from their source to their subscribers."""
