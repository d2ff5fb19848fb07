"""Archives, workers that die, long work, pages and workbooks."""
