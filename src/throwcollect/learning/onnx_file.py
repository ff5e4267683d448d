"""``model.onnx``: a graph from a target to parameters, in the units of their keys, for programs without Python."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.extras import lazily
from throwcollect.learning.distilling import DistilledMap
from throwcollect.learning.learned_map import KeyRole, LearnedMap

ONNX = "model.onnx"
_OPERATORS, _FORMAT = 13, 8
"""Versions of the operators and of the file, which are old enough for the runtimes of controllers."""

helper, numpy_helper = lazily("onnx.helper"), lazily("onnx.numpy_helper")


def encode_onnx(learned: LearnedMap, distilled: DistilledMap) -> bytes:
    """Encode a distilled map as a graph of 32-bit floats; the map that it was distilled from has the ranges.

    Its input ``target`` has the shape ``(n, n_targets + n_context)``, its output ``parameters``
    ``(n, n_parameters)``, both in the order and the units that ``model.json`` has.
    Parameters stay inside of their ranges.
    """
    chosen, given = learned.axes_of(KeyRole.PARAMETER), learned.axes_of(KeyRole.CONTEXT)
    low = np.array([*distilled.low.tolist(), *(axis.minimum for axis in given)])
    high = np.array([*distilled.high.tolist(), *(axis.maximum for axis in given)])
    least, most = (np.array([getattr(axis, end) for axis in chosen]) for end in ("minimum", "maximum"))
    polynomial = distilled.polynomial
    constants = {
        "scale": 2.0 / (high - low),
        "middle": (high + low) / 2.0,
        "exponents": polynomial.exponents,
        "coefficients": polynomial.coefficients,
        "minus_one": np.array(-1.0),
        "one": np.array(1.0),
        "half_range": (most - least) / 2.0,
        "amid": (most + least) / 2.0,
    }
    nodes = [
        helper.make_node("Sub", ["target", "middle"], ["moved"]),
        helper.make_node("Mul", ["moved", "scale"], ["scaled"]),
        helper.make_node("Unsqueeze", ["scaled", "axis"], ["rows"]),
        helper.make_node("Pow", ["rows", "exponents"], ["powers"]),
        # In this version of the operators, the axes of ReduceProd are an attribute, and those of Unsqueeze an input.
        helper.make_node("ReduceProd", ["powers"], ["terms"], axes=[2], keepdims=0),
        helper.make_node("MatMul", ["terms", "coefficients"], ["raw"]),
        helper.make_node("Clip", ["raw", "minus_one", "one"], ["inside"]),
        helper.make_node("Mul", ["inside", "half_range"], ["stretched"]),
        helper.make_node("Add", ["stretched", "amid"], ["parameters"]),
    ]
    float32 = 1  # TensorProto.FLOAT
    numbers = [numpy_helper.from_array(values.astype(np.float32), name) for name, values in constants.items()]
    axis: NDArray[np.int64] = np.array([1], np.int64)
    graph = helper.make_graph(
        nodes,
        "from a target to parameters",
        [helper.make_tensor_value_info("target", float32, ["n", len(low)])],
        [helper.make_tensor_value_info("parameters", float32, ["n", len(chosen)])],
        [*numbers, numpy_helper.from_array(axis, "axis")],
    )
    operators = [helper.make_opsetid("", _OPERATORS)]
    model = helper.make_model(graph, producer_name="throwcollect", opset_imports=operators, ir_version=_FORMAT)
    encoded: bytes = model.SerializeToString(deterministic=True)
    return encoded
