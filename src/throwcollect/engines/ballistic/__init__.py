"""An engine without contacts, for trying things out and for tests: some ten times as fast as Bullet."""
