"""An engine without contacts, for first trials and for tests: some seven times as fast as Bullet."""
