"""Work over processes and machines: how it is shared out, and what happens where a worker dies."""
