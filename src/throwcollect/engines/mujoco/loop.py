"""Makes the loop over the steps of a MuJoCo world: compiled, if Numba is installed, else in Python, to the same bits.

Numba compiles `stepping` once, for all processors of a kind. The result lies where Python keeps compiled modules or, if
that cannot be written, where runs are remembered. From there, llvmlite alone loads it in 50 ms.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.mujoco import stepping
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.files import write_file
from throwcollect.state_directory import state_directory

_HELPERS = (
    *(stepping.turn, stepping.square_exactly, stepping.measure_length),
    *(stepping.note_presses, stepping.find_gap, stepping.aim_contacts, stepping.write_sample, stepping.copy),
)
"""What `stepping.take_steps` calls, each behind those that it calls itself."""

_OFF = "NUMBA_DISABLE_JIT"
"""Numba's own environment variable against compiling."""

_NAME = "take_steps"
_DIRECTORY = Path(__file__).parent / "__pycache__"
_DIGEST_BYTES = hashlib.sha256().digest_size
_C_TYPES = {"int": ctypes.c_int64, "float": ctypes.c_double}
"""Types of the arguments of `stepping.take_steps` that are no addresses."""


class Loop(NamedTuple):
    """The loop over the steps.

    Attributes:
        take_steps: The function `stepping.take_steps`.
        list_world: Makes its arguments up to `origin`, of a model and its data.
        share: Makes its memory, of an array that outlives it.
        is_compiled: Whether it is compiled.
        made: How it was made, for people.
    """

    take_steps: Callable[..., int]
    list_world: Callable[[mujoco.MjModel, mujoco.MjData], list[Any]]
    share: Callable[[NDArray[Any]], Any]
    is_compiled: bool
    made: str


def check_version() -> None:
    """Refuse another MuJoCo than the one whose structures `stepping` knows."""
    if mujoco.__version__ != stepping.VERSION:
        hint = "pip install 'throwcollect[mujoco]'"
        raise ConfigError(f"this needs MuJoCo {stepping.VERSION}, {mujoco.__version__} is installed", hint=hint)


@cache
def make_loop() -> Loop:
    """Make the loop; compiling it takes some seconds, if no earlier process of this machine has done so."""
    if os.environ.get(_OFF, "") not in ("", "0"):
        return _make_plain(f"{_OFF} is set")
    try:
        return _make_compiled()
    except ModuleNotFoundError:
        return _make_plain("Numba is not installed (try: pip install 'throwcollect[mujoco]')")
    except Exception as error:  # noqa: BLE001 - whatever an unsuitable Numba raises, Python computes the same
        return _make_plain(f"{type(error).__name__}: {error}".partition("\n")[0])


def _make_plain(why: str) -> Loop:
    def invert(model: mujoco.MjModel, data: mujoco.MjData, flag: int, result: memoryview) -> None:
        mujoco.mj_rne(model, data, flag, np.asarray(result))

    def view(kind: Any, address: int, size: int) -> Any:
        return memoryview((ctypes.c_char * size).from_address(address)).cast("B").cast(kind)

    def list_world(model: mujoco.MjModel, data: mujoco.MjData) -> list[Any]:
        ints, words = (view(kind, data._address, 8 * (1 + stepping.EFC_AREF)) for kind in "iq")
        origin = words[stepping.ARENA]
        return [model, data, None, ints, words, *(view(kind, origin, data.narena) for kind in "di"), origin]

    take_steps = _bind(stepping.take_steps, {"mj_rne": invert})
    share: Any = memoryview
    return Loop(take_steps, list_world, share, False, f"in Python, as {why}")


def _make_compiled() -> Loop:
    from llvmlite import __version__, binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    path = next(Path(mujoco.__file__).parent.glob("libmujoco.*"))
    library = ctypes.CDLL(str(path))
    for name in ("mj_step1", "mj_step2", "mj_rne", "sqrt"):
        binding.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    # MuJoCo would look at the clock a dozen times in each step, for statistics that are never read.
    ctypes.c_void_p.in_dll(library, "mjcb_time").value = None
    # No processor is named, so that another one of this kind can use the result.
    machine = binding.Target.from_default_triple().create_target_machine(opt=3)
    facts = f"{path.name} {path.stat().st_size} {__version__} {platform.machine()}"
    content, made = _keep(facts, lambda: machine.emit_object(binding.parse_assembly(_compile())))
    executor = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
    executor.add_object_file(binding.ObjectFileRef.from_data(content))
    executor.finalize_object()
    types: list[Any] = [_C_TYPES.get(kind, ctypes.c_void_p) for kind in _list_kinds()]
    take_steps = ctypes.CFUNCTYPE(ctypes.c_int64, *types)(executor.get_function_address(_NAME))

    def list_world(model: mujoco.MjModel, data: mujoco.MjData) -> list[Any]:
        # The arena is counted from address 0.
        return [model._address, data._address, model.opt.gravity.ctypes.data, *[data._address] * 2, 0, 0, 0]

    # The code lives as long as its executor.
    take_steps.executor = executor  # type: ignore[attr-defined]
    return Loop(take_steps, list_world, lambda numbers: numbers.ctypes.data, True, made)


def _keep(facts: str, compile_loop: Callable[[], bytes]) -> tuple[bytes, str]:
    """Read the compiled loop, or compile and keep it; return its content, and how that was done."""
    sources = [path.read_bytes() for path in (Path(stepping.__file__), Path(__file__))]
    name = f"{_NAME}.{hashlib.sha256(b''.join(sources) + facts.encode()).hexdigest()[:16]}.o"
    paths = [_DIRECTORY / name]
    with suppress(ConfigError):
        paths.append(state_directory() / name)
    for path in paths:
        with suppress(OSError):
            kept = path.read_bytes()
            # LLVM would crash on a damaged file.
            if hashlib.sha256(kept[_DIGEST_BYTES:]).digest() == kept[:_DIGEST_BYTES]:
                return kept[_DIGEST_BYTES:], "compiled"
    content = compile_loop()
    for path in paths:
        with suppress(OSError, ThrowcollectError):
            path.parent.mkdir(exist_ok=True)
            for old in _DIRECTORY.glob(f"{_NAME}.*.o"):
                old.unlink()
            write_file(path, hashlib.sha256(content).digest() + content)
            return content, "compiled"
    return content, "compiled by each process anew, as neither its own directory nor that of runs can be written"


def _compile() -> str:
    """Compile the loop with Numba, into the language of LLVM."""
    from numba import cfunc, njit, types

    world, names = types.voidptr, dict[str, Any]()
    floats, words, integers = map(types.CPointer, (types.float64, types.int64, types.int32))
    for step in ("mj_step1", "mj_step2"):
        names[step] = types.ExternalFunction(step, types.void(world, world))
    names["mj_rne"] = types.ExternalFunction("mj_rne", types.void(world, world, types.int32, floats))
    for helper in _HELPERS:
        names[helper.__name__] = njit(error_model="numpy", inline="always")(_bind(helper, names))
    kinds = {"World": world, "Floats": floats, "Words": words, "Ints": integers}
    kinds |= {"int": types.int64, "float": types.float64}
    signature = types.int64(*(kinds[kind] for kind in _list_kinds()))
    compiled = cfunc(signature, error_model="numpy")(_bind(stepping.take_steps, names))
    return str(compiled.inspect_llvm()).replace(compiled.native_name, _NAME)


def _list_kinds() -> list[str]:
    """List the annotations of the arguments of `stepping.take_steps`."""
    return [kind for name, kind in stepping.take_steps.__annotations__.items() if name != "return"]


def _bind(function: Callable[..., Any], names: dict[str, Any]) -> Any:
    """Let a function of `stepping` find other things under some names."""
    return FunctionType(function.__code__, {**vars(stepping), **names}, function.__name__)
