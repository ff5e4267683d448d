"""The command line: each command parses its options, calls one function of another room, and prints what it returns.

Options that several commands share, tables, JSON and exit codes have one place each. This room never decides anything
about runs, datasets or models.
"""
