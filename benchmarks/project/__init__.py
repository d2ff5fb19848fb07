"""The release as built, and whether tests would notice wrong code."""
