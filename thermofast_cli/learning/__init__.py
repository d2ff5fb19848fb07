"""What past runs of a machine say of the run at hand."""
