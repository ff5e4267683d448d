"""Nodes as containers of a Docker engine, and the image that these are made from."""
