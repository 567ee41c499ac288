"""Columns between Arrow and NumPy by their buffers: Arrow's own way imports pandas first, which takes a
quarter of a second of every command."""

import numpy as np
import pyarrow as pa


def numbers_of(column: pa.ChunkedArray) -> np.ndarray:
    """(N,) of a column of float64; gaps are NaN."""
    parts = [_numbers(chunk) for chunk in column.chunks if len(chunk)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _numbers(chunk: pa.Array) -> np.ndarray:
    known, cells = chunk.buffers()
    numbers = np.frombuffer(cells, float, len(chunk), 8 * chunk.offset)
    if not chunk.null_count:
        return numbers
    bits = np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")
    return np.where(bits[chunk.offset : chunk.offset + len(chunk)], numbers, np.nan)


def column_of(values: np.ndarray) -> pa.Array:
    """Numbers (N,), whose NaN are gaps, or texts (N,)."""
    if values.dtype.kind == "U":
        cells = [text.encode() for text in values.tolist()]
        ends = np.cumsum([0, *map(len, cells)])
        buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(cells))]
        return pa.Array.from_buffers(pa.large_string(), len(cells), buffers)
    if values.dtype.kind not in "iuf":
        return pa.array(values, from_pandas=True)
    gaps = np.isnan(values) if values.dtype.kind == "f" else np.zeros(0, bool)
    known = pa.py_buffer(np.packbits(~gaps, bitorder="little")) if gaps.any() else None
    buffers = [known, pa.py_buffer(np.ascontiguousarray(values))]
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)
