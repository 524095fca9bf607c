"""Calls of C functions by their addresses, and values in memory by theirs, for compiled code.

Small intrinsics of numba, which take addresses as integers.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import alloca_once
from numba.extending import intrinsic

_BYTE = ir.IntType(8)
_POINTER = _BYTE.as_pointer()
_LLVM = {"p": _POINTER, "n": ir.IntType(64), "d": ir.DoubleType(), "i": ir.IntType(32), "b": _BYTE}
_NUMBA = {"p": types.intp, "n": types.intp, "d": types.float64, "i": types.int32, "b": types.uint8}


def call_signature(arguments: str) -> Any:
    """Signature and code of a call ``int f(...)``: p pointer, n size_t, d double, i int, b bool or char.

    The status is unsigned: a negative one, which FMI does not define, is larger than all others.
    """

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(32), [_LLVM[a] for a in arguments])
        function = builder.inttoptr(values[0], kind.as_pointer())
        passed = [
            builder.inttoptr(value, _POINTER) if a == "p" else value
            for a, value in zip(arguments, values[1:], strict=True)
        ]
        return builder.call(function, passed)

    return types.uint32(types.intp, *(_NUMBA[a] for a in arguments)), emit


def _load(kind: Any, stored: ir.Type) -> Any:
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], stored.as_pointer()))

    return kind(types.intp), emit


def _store(kind: Any, stored: ir.Type) -> Any:
    def emit(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        builder.store(values[1], builder.inttoptr(values[0], stored.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.intp, kind), emit


@intrinsic
def values_2(_typing, f, instance, references, count, values):  # type: ignore[no-untyped-def]
    """Get or set values with a function of FMI 1 or 2."""
    return call_signature("ppnp")


@intrinsic
def values_3(_typing, f, instance, references, count, values, size):  # type: ignore[no-untyped-def]
    """Get or set values with a function of FMI 3."""
    return call_signature("ppnpn")


@intrinsic
def do_step_1(_typing, f, instance, time, step, new_step):  # type: ignore[no-untyped-def]
    """Call fmiDoStep of FMI 1."""
    return call_signature("pddb")


@intrinsic
def do_step_2(_typing, f, instance, time, step, no_return):  # type: ignore[no-untyped-def]
    """Call fmi2DoStep."""
    return call_signature("pddi")


@intrinsic
def do_step_3(_typing, f, instance, time, step, no_return, event, end, early, reached):  # type: ignore[no-untyped-def]
    """Call fmi3DoStep."""
    return call_signature("pddbpppp")


@intrinsic
def call_mode(_typing, f, instance):  # type: ignore[no-untyped-def]
    """Call a function whose only argument is the instance."""
    return call_signature("p")


@intrinsic
def update_3(_typing, f, instance, again, end, nominals, states, defined, time):  # type: ignore[no-untyped-def]
    """Call fmi3UpdateDiscreteStates."""
    return call_signature("ppppppp")


@intrinsic
def stack_memory(_typing):  # type: ignore[no-untyped-def]
    """Return the address of 16 bytes that the FMU may write to until the calling function returns."""

    def emit(_context: Any, builder: Any, _signature: Any, _values: Any) -> Any:
        place = alloca_once(builder, ir.ArrayType(ir.IntType(64), 2))
        return builder.ptrtoint(place, ir.IntType(64))

    return types.intp(), emit


@intrinsic
def pointer(_typing, address):  # type: ignore[no-untyped-def]
    """Return an address as a pointer, of which ``carray`` makes an array."""

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], _POINTER)

    return types.voidptr(types.intp), emit


def _typed(kind: Any, stored: ir.Type) -> tuple[Any, Any]:
    @intrinsic
    def load(_typing, address):  # type: ignore[no-untyped-def]
        return _load(kind, stored)

    @intrinsic
    def store(_typing, address, value):  # type: ignore[no-untyped-def]
        return _store(kind, stored)

    return load, store


load_f8, store_f8 = _typed(types.float64, ir.DoubleType())
load_f4, store_f4 = _typed(types.float32, ir.FloatType())
load_i1, store_i1 = _typed(types.int8, ir.IntType(8))
load_u1, store_u1 = _typed(types.uint8, ir.IntType(8))
load_i2, store_i2 = _typed(types.int16, ir.IntType(16))
load_u2, store_u2 = _typed(types.uint16, ir.IntType(16))
load_i4, store_i4 = _typed(types.int32, ir.IntType(32))
load_u4, store_u4 = _typed(types.uint32, ir.IntType(32))
load_i8, store_i8 = _typed(types.int64, ir.IntType(64))
load_u8, store_u8 = _typed(types.uint64, ir.IntType(64))


@intrinsic
def next_number(_typing, number):  # type: ignore[no-untyped-def]
    """Return the next larger number than one that is not negative."""

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        bits = builder.bitcast(values[0], ir.IntType(64))
        return builder.bitcast(builder.add(bits, ir.IntType(64)(1)), ir.DoubleType())

    return types.float64(types.float64), emit
