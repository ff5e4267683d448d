"""A report on a dataset: one page that needs nothing else."""
