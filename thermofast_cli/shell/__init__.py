"""What the commands share: options, settings file, reading the runs, delivering the records."""
