"""What uncertainty does to a result: polynomial chaos, reliability, first passages."""
