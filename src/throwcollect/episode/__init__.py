"""What one trial yielded: samples, contacts and results, and the MCAP chunk they travel and rest in."""
