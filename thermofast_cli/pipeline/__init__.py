"""Each analysis over runs that are read: settings in, a frozen result out. Commands and library stand on these alike."""
