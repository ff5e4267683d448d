"""Models of a dataset: where trials end, which parameters reach a target, and how another world differs.

`fit` makes a model, `aim` inverts it, `score` measures it, and `cover` repeats collecting and aiming. This room never
starts a node or changes a dataset.
"""
