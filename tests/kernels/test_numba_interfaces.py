"""A canary: each private interface of Numba that the kernels are built on has a test (docs/decisions/0002).

A version of Numba that changes one fails here, by name, before something stranger fails elsewhere.
"""

from __future__ import annotations

import inspect
import os
import pickle
import re
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from vedette.kernels.base.compile import JIT_ENABLED, SIGNATURES, borrowing, kernel
from vedette.kernels.base.dispatchers import WholeKernel
from vedette.kernels.base.libraries import PartLibrary, WholeLibrary
from vedette.kernels.base.types import Motion
from vedette.models import constant_survival, constant_velocity
from vedette.models.motion import kernel_motion

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")


def _double(values: np.ndarray) -> float:
    return float(2.0 * values[0])


def _triple(values: np.ndarray) -> float:
    return float(3.0 * values[0])


_kernel: Any = kernel(_double)
_doubled: Any = _kernel.whole if JIT_ENABLED else _double


def takes(function: Callable[..., Any], *names: str) -> bool:
    return tuple(inspect.signature(function).parameters) == names


def survival() -> Any:
    """The dispatcher of a model function."""
    function: Any = constant_survival(0.9).function
    function.bind()
    return function.dispatcher


def test_core_registry_cpu_dispatcher() -> None:
    assert isinstance(_doubled, CPUDispatcher)
    assert isinstance(survival(), CPUDispatcher)
    for name in ("compile", "disable_compile", "get_compile_result"):
        assert callable(getattr(CPUDispatcher, name))


def test_dispatcher_cache_attribute() -> None:
    """What stands there is asked for three things; the cache behind it is Numba's own, set up when it is asked."""
    for method in (CPUDispatcher.compile, CPUDispatcher.stats.fget):
        asked = set(re.findall(r"_cache\.(\w+)", inspect.getsource(method)))
        assert asked <= {"load_overload", "save_overload", "cache_path"} <= vars(type(_doubled._cache)).keys()
    assert {"_cache_file", "_cache_path", "_impl"} <= vars(_doubled._cache.own).keys()


def test_dispatcher_typeof_pyval() -> None:
    """Asked for the types of arguments that the quick way does not know."""
    asked = []

    class Asked(CPUDispatcher):
        def typeof_pyval(self, val: Any) -> Any:
            asked.append(type(val))
            return super().typeof_pyval(val)

    bundle = kernel_motion(constant_velocity(1.0), constant_survival(0.9))
    assert Asked(lambda motion: motion.method, targetoptions={"nopython": True})(bundle) == bundle.method
    assert set(asked) == {Motion}


def test_dispatcher_reduce_states_and_rebuild() -> None:
    states = ["uuid", "py_func", "locals", "targetoptions", "can_compile", "sigs"]
    assert sorted(_doubled._reduce_states()) == sorted(states)
    assert takes(CPUDispatcher._rebuild, *states)


def test_dispatcher_overloads_by_argument_types() -> None:
    arguments, _ = normalize_signature(SIGNATURES["prob_survival"][1])
    assert list(survival().overloads) == [tuple(arguments)]


def test_compile_result_library_and_fndesc() -> None:
    arguments, result = normalize_signature(SIGNATURES["prob_survival"][1])
    compiled = survival().get_compile_result(result(*arguments))
    for name in (compiled.fndesc.llvm_cfunc_wrapper_name, compiled.fndesc.llvm_func_name):
        assert compiled.library.get_pointer_to_function(name) > 0


def test_core_compiler_lock_global_compiler_lock() -> None:
    """One thread may take it twice, and compiling waits for it."""
    from numba.core.compiler_lock import global_compiler_lock

    done = threading.Event()

    def compile_one() -> None:
        _doubled(np.ones(1, np.float32))
        done.set()

    compiling = threading.Thread(target=compile_one)
    with global_compiler_lock, global_compiler_lock:
        compiling.start()
        assert not done.wait(0.5)
    compiling.join(timeout=300)
    assert done.is_set()


def test_core_caching_compile_result_cache_impl_and_function_cache() -> None:
    from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

    assert FunctionCache._impl_class is CompileResultCacheImpl
    assert isinstance(CompileResultCacheImpl._locator_classes, list)
    assert takes(IndexDataCacheFile.save, "self", "key", "data")
    assert takes(IndexDataCacheFile.load, "self", "key")
    assert takes(IndexDataCacheFile.flush, "self")
    assert isinstance(_doubled._cache.own._impl.filename_base, str)


def test_core_caching_locator_protocol() -> None:
    from numba.core.caching import _CacheLocator

    assert _CacheLocator.__abstractmethods__ == {"get_cache_path", "get_source_stamp", "get_disambiguator"}
    assert takes(_CacheLocator.from_function, "py_func", "py_file")
    assert takes(_CacheLocator.ensure_cache_path, "self")


def test_core_serialize_dumps() -> None:
    from numba.core.serialize import dumps

    assert pickle.loads(dumps((1, "one"))) == (1, "one")


def test_core_config_switches() -> None:
    from numba.core import config

    assert config.DISABLE_JIT in (0, 1, False, True)
    assert config.BOUNDSCHECK in (None, 0, 1, False, True)


def test_core_options_nrt_and_forceinline() -> None:
    from numba.core.options import DefaultOptions

    assert DefaultOptions._nrt.flag_name == "nrt"
    assert DefaultOptions.forceinline.flag_name == "forceinline"
    assert DefaultOptions.no_cpython_wrapper.flag_name == "no_cpython_wrapper"
    assert DefaultOptions.no_cfunc_wrapper.flag_name == "no_cfunc_wrapper"


def test_core_codegen_libraries() -> None:
    """What only kernels call is a part without machine code; what Python calls is made of all parts that it reaches."""
    from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

    inner: Any = kernel(_double)
    tripled: Any = borrowing(_triple)
    middle: Any = kernel(lambda values: inner(values) + tripled(values))
    outer: Any = kernel(lambda values: middle(values) + tripled(values))
    assert outer(np.array([2.0])) == 16.0
    for part in (inner, tripled, middle):
        (compiled,) = part.part.overloads.values()
        assert isinstance(compiled.library, PartLibrary)
        assert compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0
    (whole,) = outer.whole.overloads.values()
    assert isinstance(whole.library, WholeLibrary)
    assert len(whole.library._linking_libraries) >= 3
    assert JITCPUCodegen._library_class is JITCodeLibrary


def test_core_registry_contexts_and_core_runtime() -> None:
    """What was compiled before is loaded without all that compiling needs."""
    code = "from vedette.kernels.gaussian.linalg import log_sum; import numpy as np, sys; log_sum(np.zeros(1));"
    for _ in range(2):
        command = [sys.executable, "-c", code + "print('numba.np.linalg' in sys.modules)"]
        result = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert result.stdout.split() == ["False"], result.stderr


def test_a_whole_is_kept_as_machine_code_alone() -> None:
    name, kind, (code, defined) = fresh(_triple).library.serialize_using_object_code()
    assert "triple" in name
    assert (kind, type(code)) == ("object", bytes)
    assert any("triple" in symbol for symbol in defined)


def fresh(function: Callable[..., Any]) -> Any:
    """What compiling a kernel gives, not read from disk."""
    whole: Any = WholeKernel(function, targetoptions={"nopython": True})
    whole.compile("(float64[::1],)")
    (compiled,) = whole.overloads.values()
    return compiled


def test_core_imputils_lower_constant() -> None:
    """A compiled function of one's own may name a model function."""
    function: Any = constant_survival(0.9).function
    own = numba.njit(lambda state, dt, params: function(state, dt, params))
    assert own(np.zeros(4), 1.0, np.array([0.9])) == 0.9


def test_a_function_of_ones_own_may_call_a_kernel() -> None:
    first: Any = kernel(_double)
    second: Any = kernel(lambda values: first(values) + 1.0)
    own = numba.njit(lambda values: second(values))
    assert own(np.array([2.0])) == 5.0


def test_an_exception_of_a_part_reaches_python_from_disk_too(tmp_path: Path) -> None:
    """The environments of all parts are told to what they are part of."""
    (tmp_path / "own.py").write_text(RAISES, encoding="utf-8")
    environment = {**os.environ, "VEDETTE_CACHE_DIR": str(tmp_path)}
    for _ in range(2):
        command = [sys.executable, "own.py"]
        result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600)
        assert result.stdout.split() == ["ModelError", "ValueError", "4.0"], result.stderr


RAISES = """
import numpy as np
from vedette.errors import ModelError
from vedette.kernels.base.compile import inlined, kernel

@inlined
def inner(values):
    if values[0] > 2.0:
        raise ValueError("too large")
    return 2.0 * values[0]

@kernel
def middle(values):
    if values[0] < 0.0:
        raise ModelError("negative")
    return inner(values)

@kernel
def outer(values):
    return middle(values)

for first in (-1.0, 3.0, 2.0):
    try:
        print(outer(np.array([first])))
    except Exception as error:
        print(type(error).__name__)
"""


def test_experimental_function_type_function_model() -> None:
    """The struct that is filled at every call of a kernel, by name; `core.cgutils` makes it."""
    from numba.core import cgutils
    from numba.core.datamodel import default_manager
    from numba.experimental.function_type import FunctionModel

    model = default_manager.lookup(survival().model._numba_type_)
    assert isinstance(model, FunctionModel)
    assert sorted(model._fields) == ["c_addr", "jit_addr", "py_addr"]
    assert callable(cgutils.create_struct_proxy)


def test_only_versions_of_numba_below_the_next_are_taken() -> None:
    """An upper bound, just above the locked version; whoever raises it reads these tests."""
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
    (bound,) = [entry for entry in dependencies if entry.startswith("numba")]
    matched = re.fullmatch(r"numba>=0\.(\d+),<0\.(\d+)", bound)
    assert matched is not None
    locked = re.search(r"^numba==0\.(\d+)", (ROOT / "requirements/runtime.txt").read_text("utf-8"), re.MULTILINE)
    assert locked is not None
    assert int(matched[1]) <= int(locked[1]) == int(matched[2]) - 1
    assert int(matched[1]) <= int(numba.__version__.split(".")[1]) < int(matched[2])
