"""An engine without contacts, for first trials and for tests: some ten times as fast as Bullet."""
