"""Datasets for others: files in other formats, reports, and what viewers open.

Each part reads throws through `dataset` and writes files next to the dataset or where the user asks for them. This room
never changes a dataset.
"""
