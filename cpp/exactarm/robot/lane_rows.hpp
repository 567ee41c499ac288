// Rows of a batch to and from the lanes: eight rows are read or written together.
// Rows beyond `end` repeat the last one when read and are dropped when written.
#pragma once

#include <algorithm>

#include "exactarm/base/lanes.hpp"

namespace exactarm {

// out[i] lane r = data[(row + r) * stride + i].
inline void load_rows(const double* data, long stride, long row, long end, int width, Lanes* out) {
  for (int lane = 0; lane < Lanes::kCount; ++lane) {
    const double* from = data + std::min(row + lane, end - 1) * stride;
    for (int i = 0; i < width; ++i) out[i].set(lane, from[i]);
  }
}

// Transposes an 8 x 8 block in three exchanges of halves.
inline void transpose(const Lanes* in, Lanes* out) {
  using V = Lanes::Native;
  V a[8], b[8];
  for (int i = 0; i < 8; i += 2) {
    a[i] = __builtin_shufflevector(in[i].v, in[i + 1].v, 0, 8, 2, 10, 4, 12, 6, 14);
    a[i + 1] = __builtin_shufflevector(in[i].v, in[i + 1].v, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int half = 0; half < 8; half += 4)
    for (int i = half; i < half + 2; ++i) {
      b[i] = __builtin_shufflevector(a[i], a[i + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      b[i + 2] = __builtin_shufflevector(a[i], a[i + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int i = 0; i < 4; ++i) {
    out[i].v = __builtin_shufflevector(b[i], b[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    out[i + 4].v = __builtin_shufflevector(b[i], b[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
}

// data[(row + r) * stride + i] = values[i] lane r. `values` is readable up to the next multiple of eight.
inline void store_rows(const Lanes* values, long stride, long row, long end, int width, double* data) {
  const int rows = static_cast<int>(std::min<long>(Lanes::kCount, end - row));
  Lanes turned[Lanes::kCount];
  for (int first = 0; first < width; first += Lanes::kCount) {
    transpose(values + first, turned);
    double* to = data + row * stride + first;
    const int count = std::min(Lanes::kCount, width - first);
    if (count == Lanes::kCount)
      for (int r = 0; r < rows; ++r) __builtin_memcpy(to + r * stride, &turned[r], sizeof(Lanes));
    else
      for (int r = 0; r < rows; ++r)
        for (int i = 0; i < count; ++i) to[r * stride + i] = turned[r][i];
  }
}

// Numbers of `count` values rounded up to whole blocks of lanes.
inline int padded(int count) { return (count + Lanes::kCount - 1) / Lanes::kCount * Lanes::kCount; }

}  // namespace exactarm
