// The joint spring: torque, slope, energy, and the deflection that a torque asks for.
//   kappa(e) = k1 e + k3 e^3,   e = phi + q_offset - q         (thesis section 2.2.2, sign of E4)
// The inverse is the root of the cubic on the branch through zero (Cardano in hyperbolic form):
//   k3 > 0:  e = 2 r sinh(asinh(x) / 3),  r = sqrt(k1 / (3 |k3|)),  x = 3 tau / (2 k1 r)
//   k3 < 0:  e = 2 r sin(asin(x) / 3),    a softening spring holds only |x| <= 1
// with one Newton step against rounding. k1 = 0 (and k3 = 0) is a rigid joint: e = 0 for every torque.
// rad, Nm, Nm/rad, Nm/rad^3, J.
#pragma once

#include <cmath>

#include "exactarm/robot/robot.hpp"

namespace exactarm {

inline bool is_rigid(const Spring& spring) { return spring.linear == 0.0; }

// Throws InvalidArgument unless the spring is rigid or stiffens from a positive slope at zero.
inline void require_spring(const std::string& name, const Spring& spring) {
  require_finite(name + ", cubic", spring.cubic);
  if (is_rigid(spring) && spring.cubic == 0.0) return;
  require_positive(name + ", linear", spring.linear);
}

inline double spring_torque(const Spring& spring, double e) {
  return (spring.linear + spring.cubic * e * e) * e;
}
inline double spring_stiffness(const Spring& spring, double e) {
  return spring.linear + 3.0 * spring.cubic * e * e;
}
inline double spring_energy(const Spring& spring, double e) {
  return (0.5 * spring.linear + 0.25 * spring.cubic * e * e) * e * e;
}

inline double spring_deflection(const Spring& spring, double torque) {
  const double k1 = spring.linear, k3 = spring.cubic;
  if (is_rigid(spring)) return 0.0;
  if (k3 == 0.0) return torque / k1;
  const double r = std::sqrt(k1 / (3.0 * std::abs(k3)));
  const double x = 1.5 * torque / (k1 * r);
  if (k3 < 0.0 && std::abs(x) > 1.0)
    throw InvalidArgument("torque on a softening spring: expected at most " +
                          std::to_string(2.0 * k1 * r / 3.0) + " Nm, found " + std::to_string(torque));
  const double e =
      k3 > 0.0 ? 2.0 * r * std::sinh(std::asinh(x) / 3.0) : 2.0 * r * std::sin(std::asin(x) / 3.0);
  const double slope = spring_stiffness(spring, e);
  return slope > 0.0 ? e - (spring_torque(spring, e) - torque) / slope : e;
}

// value[k] = d^k kappa^{-1} / d tau^k, k = 0..3.
struct DeflectionDerivatives {
  double value[4];
};

inline DeflectionDerivatives spring_deflection_derivatives(const Spring& spring, double torque) {
  if (is_rigid(spring)) return {{0.0, 0.0, 0.0, 0.0}};
  const double e = spring_deflection(spring, torque);
  const double slope = spring_stiffness(spring, e), curvature = 6.0 * spring.cubic * e,
               third = 6.0 * spring.cubic;
  const double compliance = 1.0 / slope, cubed = compliance * compliance * compliance;
  return {{e, compliance, -curvature * cubed,
           (3.0 * curvature * curvature - slope * third) * cubed * compliance * compliance}};
}

}  // namespace exactarm
