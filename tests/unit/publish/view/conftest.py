"""Fixtures for small collections, shared with the tests of `dataset`."""

from tests.unit.dataset.conftest import collected, collection, dataset, make_collection

__all__ = ["collected", "collection", "dataset", "make_collection"]
