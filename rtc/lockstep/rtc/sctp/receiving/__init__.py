"""The receiving half of an association: chunks to messages, and their acknowledgement."""
