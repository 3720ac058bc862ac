"""The sending half of an association: messages to chunks, and these until they are acknowledged or given up."""
