"""What writes a page of the documentation, its pictures or the notebook."""
