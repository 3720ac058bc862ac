"""The control seat: who drives, who asks for it, and who may let a policy drive."""
