// Points that a new one may not be worse than in both respects, the objective and the violation of the
// equations (Fletcher and Leyffer 2002, Nonlinear programming without a penalty function).
#pragma once

#include <vector>

namespace exactarm::ocp {

struct Merit {
  double objective;  // scaled
  double violation;  // sum of the magnitudes of all equations, rad
};

class Filter {
 public:
  static constexpr double kMargin = 1e-5;  // of the violation: what counts as better

  // Memory for that many points; more would allocate.
  explicit Filter(long points) { points_.reserve(static_cast<std::size_t>(points)); }

  void add(const Merit& point) { points_.push_back(point); }
  // Whether `point` is better than each earlier one in one of the two at least.
  bool accepts(const Merit& point) const;

 private:
  std::vector<Merit> points_;
};

}  // namespace exactarm::ocp
