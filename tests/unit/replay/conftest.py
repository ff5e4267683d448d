"""Small collections, as the tests of `dataset` have them."""

from tests.unit.dataset.conftest import collected, collection, dataset, make_collection

__all__ = ["collected", "collection", "dataset", "make_collection"]
