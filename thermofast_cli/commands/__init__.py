"""One file per command, named after it; each exports ``command``."""
