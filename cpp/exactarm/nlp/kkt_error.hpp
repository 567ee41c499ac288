// How far a point is from satisfying the first-order conditions of a Problem, recomputed from the
// problem's own functions, whatever solver the point came from:
//   stationarity     max |grad f + J' lambda - z_low + z_high|   over the variables that are not fixed
//   feasibility      max violation of a constraint or a bound
//   complementarity  max |z_low (x - x_low)|, |z_high (x_high - x)|; likewise lambda of inequalities
//   sign             max negative part of a bound multiplier
// in the units of the problem. f is multiplied by `objective_scale` as the solver did.
#pragma once

#include "exactarm/nlp/problem.hpp"

namespace exactarm::nlp {

struct Point {
  Vector x, lambda, z_low, z_high;
};

struct KktError {
  double stationarity = 0.0, feasibility = 0.0, complementarity = 0.0, sign = 0.0;
  double largest() const;
};

KktError kkt_error(Problem& problem, const Point& point, double objective_scale = 1.0);

}  // namespace exactarm::nlp
