"""Pictures, a file for each kind of result."""
