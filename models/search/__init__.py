"""The search for a missing effect: candidates, scans, judgement, verdict."""
