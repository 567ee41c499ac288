#include "exactarm/nlp/kkt_error.hpp"

#include <algorithm>
#include <cmath>

namespace exactarm::nlp {
namespace {

// A NaN must never look like a small error.
inline void raise(double& largest, double value) {
  if (!(std::abs(value) <= largest)) largest = std::abs(value);
}

inline void check_side(double distance, double multiplier, KktError& error) {
  if (!std::isfinite(distance)) return;
  if (!(distance >= 0.0)) raise(error.feasibility, distance);
  raise(error.complementarity, multiplier * distance);
  if (!(multiplier >= 0.0)) raise(error.sign, multiplier);
}

}  // namespace

double KktError::largest() const { return std::max({stationarity, feasibility, complementarity, sign}); }

KktError kkt_error(Problem& problem, const Point& point, double objective_scale) {
  const long n = problem.variables(), m = problem.constraints();
  Vector x_low(n), x_high(n), c_low(m), c_high(m), c(m), stationarity(n);
  problem.variable_bounds(x_low, x_high);
  problem.constraint_bounds(c_low, c_high);
  problem.constraint(point.x, c);
  problem.gradient(point.x, stationarity);
  stationarity *= objective_scale;
  const Sparsity& sparsity = problem.jacobian_sparsity();
  std::vector<double> values(sparsity.size());
  problem.jacobian(point.x, values.data());
  for (long e = 0; e < sparsity.size(); ++e)
    stationarity[sparsity.column[e]] += values[e] * point.lambda[sparsity.row[e]];
  stationarity += point.z_high - point.z_low;

  KktError error;
  for (long i = 0; i < n; ++i) {
    if (x_low[i] == x_high[i]) {
      raise(error.feasibility, point.x[i] - x_low[i]);
      continue;
    }
    raise(error.stationarity, stationarity[i]);
    check_side(point.x[i] - x_low[i], point.z_low[i], error);
    check_side(x_high[i] - point.x[i], point.z_high[i], error);
  }
  for (long j = 0; j < m; ++j) {
    if (c_low[j] == c_high[j]) {
      raise(error.feasibility, c[j] - c_low[j]);
      continue;
    }
    check_side(c[j] - c_low[j], std::max(-point.lambda[j], 0.0), error);
    check_side(c_high[j] - c[j], std::max(point.lambda[j], 0.0), error);
  }
  return error;
}

}  // namespace exactarm::nlp
