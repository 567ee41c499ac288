// Rows of a batch to and from scalars T: one row (`double`), or eight rows (`Lanes`).
// Rows beyond the end repeat the last one when read and are dropped when written.
#pragma once

#include <algorithm>

#include "exactarm/base/lanes.hpp"

namespace exactarm {

inline void load_rows(const double* data, long stride, long row, long /*end*/, int width, double* out) {
  std::copy_n(data + row * stride, width, out);
}

inline void load_rows(const double* data, long stride, long row, long end, int width, Lanes* out) {
  for (int lane = 0; lane < Lanes::kCount; ++lane) {
    const double* from = data + std::min(row + lane, end - 1) * stride;
    for (int i = 0; i < width; ++i) out[i].set(lane, from[i]);
  }
}

inline void store_rows(const double* values, long stride, long row, long /*end*/, int width, double* data) {
  std::copy_n(values, width, data + row * stride);
}

inline void store_rows(const Lanes* values, long stride, long row, long end, int width, double* data) {
  const int rows = static_cast<int>(std::min<long>(Lanes::kCount, end - row));
  for (int lane = 0; lane < rows; ++lane) {
    double* to = data + (row + lane) * stride;
    for (int i = 0; i < width; ++i) to[i] = values[i][lane];
  }
}

}  // namespace exactarm
