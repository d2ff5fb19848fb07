"""Many files into a folder of results: read, worked on and written as a stream, and taken up again after an interruption."""
