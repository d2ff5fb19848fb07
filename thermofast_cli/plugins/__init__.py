"""Effects and filters of users and of installed packages: found, checked, guarded. Nothing of theirs stops another's work."""
