// The joint spring and its inverse: torque kappa(e) = linear e + cubic e^3, e in rad, torque in Nm.
// linear > 0 and cubic >= 0, so kappa is monotone; Newton on its inverse then falls from one side.
#pragma once

#include <cmath>

#include "exactarm/robot/robot.hpp"

namespace exactarm {

inline double spring_torque(const Spring& spring, double e) { return (spring.linear + spring.cubic * e * e) * e; }

inline double spring_stiffness(const Spring& spring, double e) { return spring.linear + 3.0 * spring.cubic * e * e; }

inline double spring_deflection(const Spring& spring, double torque) {
  double e = torque / spring.linear;
  if (spring.cubic == 0.0) return e;
  for (int iteration = 0; iteration < 100; ++iteration) {
    const double step = (torque - spring_torque(spring, e)) / spring_stiffness(spring, e);
    e += step;
    if (std::abs(step) <= 1e-16 + 4e-16 * std::abs(e)) break;
  }
  return e;
}

}  // namespace exactarm
