"""The configuration: every key with its type, unit, bounds and effect, and how YAML files are read and written.

Problems have file, line, key and value, all of them at once. This room never acts on what the keys mean.
"""
