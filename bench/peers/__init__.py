"""Peers: what users pick instead, on the same throws."""
