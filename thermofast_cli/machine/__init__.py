"""What was learnt from one run of a machine, put to use on another."""
