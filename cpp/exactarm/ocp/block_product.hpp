// Products of small dense blocks, column major without padding: c (rows x cols) += a (rows x inner) b (inner
// x cols). With Rows and Inner known to the compiler a column of c stays in registers; otherwise plain loops.
#pragma once

namespace exactarm::ocp {

namespace detail {

// In structs, because a template argument loses the attributes of its type.
struct Four {
  typedef double Vector __attribute__((vector_size(32), aligned(8), may_alias));
};
struct Two {
  typedef double Vector __attribute__((vector_size(16), aligned(8), may_alias));
};

// As many rows as the chunk has lanes, of two columns of c.
template <class Chunk, int Rows, int Inner>
inline void two_columns(const double* a, const double* b, double* c) {
  typedef typename Chunk::Vector V;
  V first = *reinterpret_cast<const V*>(c), second = *reinterpret_cast<const V*>(c + Rows);
  for (int l = 0; l < Inner; ++l) {
    const V column = *reinterpret_cast<const V*>(a + l * Rows);
    first += column * b[l];
    second += column * b[Inner + l];
  }
  *reinterpret_cast<V*>(c) = first;
  *reinterpret_cast<V*>(c + Rows) = second;
}

}  // namespace detail

template <int Rows, int Inner>
inline void add_product(int rows, int inner, int cols, const double* a, const double* b, double* c) {
  int done = 0;
  if constexpr (Rows > 0 && Inner > 0 && Rows % 2 == 0) {
    for (; done + 2 <= cols; done += 2) {
      const double* b_columns = b + done * Inner;
      double* c_columns = c + done * Rows;
      int row = 0;
      for (; row + 4 <= Rows; row += 4)
        detail::two_columns<detail::Four, Rows, Inner>(a + row, b_columns, c_columns + row);
      for (; row + 2 <= Rows; row += 2)
        detail::two_columns<detail::Two, Rows, Inner>(a + row, b_columns, c_columns + row);
    }
  }
  for (int j = done; j < cols; ++j)
    for (int l = 0; l < inner; ++l) {
      const double factor = b[j * inner + l];
      for (int i = 0; i < rows; ++i) c[j * rows + i] += a[l * rows + i] * factor;
    }
}

// to (cols x rows) = from' (rows x cols).
inline void transpose(int rows, int cols, const double* from, double* to) {
  for (int j = 0; j < cols; ++j)
    for (int i = 0; i < rows; ++i) to[i * cols + j] = from[j * rows + i];
}

}  // namespace exactarm::ocp
