"""What a console has of its own: its state directory's content, what its robots share, what routes depend on."""
