// Normal equations of an angle profile: the error of one gear, averaged into narrow cells of its angle,
// against harmonics. With x the delivered angle of a cell, x + e(x) = angle (robot/harmonics.hpp):
//   rated (gyroscope):  model = (1 + level) / (1 + s(x))          output rate over motor rate
//   else (encoders):    model = e(x) + level                      motor angle less output angle
// Least squares min sum_i weight_i (value_i - model_i)^2 over a (m), b (m), level and, when asked for, the
// orders (m): thesis (3.5) by Gauss and Newton, with the exact Jacobian,
// the dependence of x on the coefficients included.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm {

struct AngleCells {
  ConstVectorRef angle, value, weight;
  bool rated;
};

// P = 2 m + 1, or 3 m + 1 with the orders: a, b, level, orders.
struct ProfileNormal {
  Matrix normal;    // J' W J (P, P)
  Vector gradient;  // J' W r (P)
  Vector residual;  // r = value - model, per cell
};

ProfileNormal profile_normal(const AngleCells& cells, const GearTable& table, double level, bool with_orders);

}  // namespace exactarm
