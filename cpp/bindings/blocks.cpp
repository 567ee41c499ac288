#include <algorithm>
#include <stdexcept>

#include "exactarm/base/block_recursion.hpp"
#include "exactarm/base/check.hpp"
#include "exactarm/base/prior_scales.hpp"

#include "binding.hpp"

namespace exactarm::bindings {
void bind_blocks(py::module_& module) {
  module.def(
      "block_recursion",
      [](const Values& before_last, const Values& last, const Values& diagonal, const Values& right) {
        if (diagonal.ndim() != 3 || right.ndim() != 3 || diagonal.shape(1) != diagonal.shape(2) ||
            right.shape(0) != diagonal.shape(0) || right.shape(1) != diagonal.shape(1))
          throw InvalidArgument("diagonal, right: expected blocks (N, n, n) and right sides (N, n, P)");
        require_size("before_last", before_last.size(), diagonal.size());
        require_size("last", last.size(), diagonal.size());
        auto x = new_array(right.shape(0), right.shape(1), right.shape(2));
        std::copy(right.data(), right.data() + right.size(), x.mutable_data());
        bool solved = false;
        {
          double* result = x.mutable_data();
          const double *a = before_last.data(), *b = last.data(), *d = diagonal.data();
          const long rows = right.shape(0), n = right.shape(1), columns = right.shape(2);
          const ReleasedGil released;
          solved = block_recursion(a, b, d, rows, n, columns, result);
        }
        if (!solved) throw std::runtime_error("a block of the diagonal is singular");
        return x;
      },
      py::arg("before_last"), py::arg("last"), py::arg("diagonal"), py::arg("right"),
      "x (N, n, P) of diagonal_t x_t = right_t - last_t x_(t-1) - before_last_t x_(t-2); blocks (N, n, n).");
  module.def(
      "gains_by_scale",
      [](const Values& gram, const Values& y, const Values& squares) {
        if (gram.ndim() != 3 || gram.shape(1) != gram.shape(2) || y.ndim() != 2 || squares.ndim() != 1 ||
            y.shape(0) != gram.shape(0) || y.shape(1) != gram.shape(1))
          throw InvalidArgument("gram, y, squares: expected (g, k, k), (g, k) and (s,)");
        const long blocks = y.shape(0), k = y.shape(1), scales = squares.size();
        auto gains = new_array(scales, blocks), prices = new_array(scales, blocks);
        {
          const double *h = gram.data(), *right = y.data(), *square = squares.data();
          double *gain = gains.mutable_data(), *price = prices.mutable_data();
          const ReleasedGil released;
          gains_by_scale(h, right, blocks, k, square, scales, gain, price);
        }
        return std::make_pair(gains, prices);
      },
      py::arg("gram"), py::arg("y"), py::arg("squares"),
      "(s, g) each: y' (I / s^2 + H)^-1 y and log det(I + s^2 H) / 2 of blocks H (g, k, k), y (g, k), for\n"
      "squares s^2 (s,).");
}

}  // namespace exactarm::bindings
