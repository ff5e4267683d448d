"""Nearest neighbours among points that become more, against one tree of all of them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from throwcollect.sweep import neighbours
from throwcollect.sweep.neighbours import Neighbours


class CountingTree(cKDTree):  # type: ignore[misc]
    """A tree that counts the points that trees were made of."""

    points = 0

    def __init__(self, points: np.ndarray) -> None:
        CountingTree.points += len(points)
        super().__init__(points)


def test_neighbours_from_several_trees_equal_those_of_one_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "_FEW", 16)
    random = np.random.default_rng(1)
    points, places = random.random((1200, 3)), random.random((50, 3))
    found = Neighbours(3)
    trees = set()
    for first in range(0, len(points), 12):
        found.append(points[first : first + 12])
        tree = cKDTree(points[: first + 12])
        for count in (1, 8, 40):
            distances, indices = found.find(places, count)
            expected = tree.query(places, range(1, min(count, tree.n) + 1))
            assert np.array_equal(distances, expected[0])
            assert np.array_equal(indices, expected[1])
        trees.add(len(found._trees))
    assert trees == {1, 2, 3, 4}


def test_of_equally_far_points_the_first_ones_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "_FEW", 4)
    found = Neighbours(1)
    found.append(np.array([[0.0], [9.0], [1.0], [9.0], [1.0]]))
    assert found.find(np.array([[0.5]]), 3)[1].tolist() in ([[0, 2, 4]], [[2, 0, 4]])


def test_many_points_are_not_sorted_again_for_each_few_that_are_appended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbours, "_FEW", 64)
    monkeypatch.setattr(neighbours.spatial, "cKDTree", CountingTree, raising=False)
    monkeypatch.setattr(CountingTree, "points", 0)
    found = Neighbours(2)
    points = np.random.default_rng(1).random((32_768, 2))
    for first in range(0, len(points), 16):
        found.append(points[first : first + 16])
    assert CountingTree.points / len(points) < 20, "all of them, each time, would be 1024"
