// The one central-difference check that every analytic derivative of the project goes through.
//   column j: (f(x + h_j e_j) - f(x - h_j e_j)) / 2 h_j, with one Richardson step (error O(h^4)).
#pragma once

#include <gtest/gtest.h>

#include <functional>

#include "exactarm/base/types.hpp"

namespace exactarm::testing {

using VectorFunction = std::function<Vector(const Vector&)>;

inline Matrix central_difference(const VectorFunction& f, const Vector& x, double step = 1e-4) {
  const long rows = f(x).size();
  Matrix jacobian(rows, x.size());
  const auto slope = [&](long j, double h) {
    Vector plus = x, minus = x;
    plus[j] += h;
    minus[j] -= h;
    return Vector((f(plus) - f(minus)) / (plus[j] - minus[j]));
  };
  for (long j = 0; j < x.size(); ++j) {
    const double h = step * std::max(1.0, std::abs(x[j]));
    jacobian.col(j) = (4.0 * slope(j, 0.5 * h) - slope(j, h)) / 3.0;
  }
  return jacobian;
}

// Checks an analytic Jacobian to `relative` of its own largest entry.
inline void expect_derivative(const VectorFunction& f, const Vector& x, const Matrix& analytic,
                              double relative = 1e-7, double step = 1e-4) {
  const Matrix numeric = central_difference(f, x, step);
  ASSERT_EQ(numeric.rows(), analytic.rows());
  ASSERT_EQ(numeric.cols(), analytic.cols());
  const double scale = std::max(1.0, analytic.cwiseAbs().maxCoeff());
  long row = 0, col = 0;
  const double worst = (numeric - analytic).cwiseAbs().maxCoeff(&row, &col);
  EXPECT_LE(worst, relative * scale) << "entry (" << row << ", " << col << "): analytic "
                                     << analytic(row, col) << ", central difference " << numeric(row, col);
}

}  // namespace exactarm::testing
