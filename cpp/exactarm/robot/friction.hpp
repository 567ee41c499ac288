// Joint or drive friction as a function of the rate v:
//   tau_f(v) = (F_c + F_s exp(-(v / v_s)^2)) s(v) + F_v v
// Coulomb, Stribeck (Armstrong-Helouvry 1991) and viscous parts; s = sign(v), zero at rest (exact), or
// tanh(v / width) (smooth, for solvers and integrators). It always opposes the motion: v tau_f >= 0.
// Nm, rad/s.
#pragma once

#include <cmath>

#include "exactarm/robot/robot.hpp"

namespace exactarm {

// width in rad/s; 0: the exact sign.
struct FrictionValue {
  double torque, slope;  // slope = d torque / d rate (without the jump of the exact sign)
};

inline FrictionValue friction(const Friction& f, double rate, double width) {
  double sign = rate > 0.0 ? 1.0 : (rate < 0.0 ? -1.0 : 0.0), sign_slope = 0.0;
  if (width > 0.0) {
    sign = std::tanh(rate / width);
    sign_slope = (1.0 - sign * sign) / width;
  }
  double dry = f.coulomb, dry_slope = 0.0;
  if (f.stribeck != 0.0) {
    const double x = rate / f.stribeck_velocity, drop = f.stribeck * std::exp(-x * x);
    dry += drop;
    dry_slope = -2.0 * x / f.stribeck_velocity * drop;
  }
  return {dry * sign + f.viscous * rate, dry * sign_slope + dry_slope * sign + f.viscous};
}

}  // namespace exactarm
