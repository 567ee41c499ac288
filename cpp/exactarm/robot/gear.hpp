// The non-constant gear: motor angle as a function of the gear's output angle, and back.
//   u(phi)  = ratio (1 + sum_j a_j cos(w_j phi) - b_j sin(w_j phi))                     thesis (2.10), E5
//   Xi(phi) = ratio (phi + sum_j (a_j sin(w_j phi) + b_j (cos(w_j phi) - 1)) / w_j)     thesis (2.13)
// u = dXi/dphi, Xi(0) = 0 in every table, theta = Xi(phi). a, b relative to the ratio; w in cycles
// per output revolution; angles in rad. Xi must be monotone (1 + ... > 0) to have an inverse.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm {

// Derivatives of Xi at one angle: value[k] = d^k Xi / dphi^k, so value[1] = u.
struct GearDerivatives {
  double value[5];
};

double gear_motor_angle(double ratio, const GearTable& table, double phi);

// d^order u / dphi^order, order 0 to 3.
double gear_ratio(double ratio, const GearTable& table, double phi, int order);

// value[0..highest], highest at most 4; entries above stay untouched.
void gear_derivatives(double ratio, const GearTable& table, double phi, int highest, GearDerivatives& out);

// Xi^{-1}: Newton inside a bracket that always holds the root, bisection where Newton leaves it.
// Converges for every table; the root is the only one when the table is monotone.
double gear_output_angle(double ratio, const GearTable& table, double theta);
// The same, started from a guess (a neighbour on a path).
double gear_output_angle(double ratio, const GearTable& table, double theta, double guess);

// Whether u / ratio > 0 on two output revolutions to either side; when not, `where` is a place that fails.
// Throws InvalidArgument where that would take longer than some 0.1 s to tell.
bool gear_is_monotone(const GearTable& table, double* where = nullptr);

// Throws InvalidArgument naming the gear (such as "gear of joint 3, cw").
void require_gear(const std::string& name, double ratio, const GearTable& table);

// Table of one direction of motion: -1 clockwise (the motor angle falls), +1 counter-clockwise,
// 0 (at rest) the mean of both functions.
GearTable gear_table(const Gear& gear, int direction);

// Between the tables: Xi = (1 - direction) / 2 Xi_cw + (1 + direction) / 2 Xi_ccw, direction in [-1, 1], for
// a ratio of 1 (theta / ratio). Derivatives 0 to `highest` (at most 4), and the inverse.
void gear_derivatives(const Gear& gear, double direction, double phi, int highest, GearDerivatives& out);
double gear_output_angle(const Gear& gear, double direction, double theta);

}  // namespace exactarm
