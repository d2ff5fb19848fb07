"""Models learnt of a machine and priors of a lab, their files, and what they carry over to another run."""
