"""Datasets in the formats that others read: one module a format, all fed by the same description of the columns."""
