"""Whether files are read right, or refused in words, and how fast."""
