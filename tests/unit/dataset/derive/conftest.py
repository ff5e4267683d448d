"""The fixtures of the tests of `dataset`: small collections."""

from tests.unit.dataset.conftest import collected, collection, dataset, make_collection

__all__ = ["collected", "collection", "dataset", "make_collection"]
