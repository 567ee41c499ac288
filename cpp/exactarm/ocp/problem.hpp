// The optimal control problem (4.2): the motor motion that puts the link on the reference.
//   min  sum_k |q_k - q_d,k|^2 + nu |input_k|^2       (4.3a), E11; input = theta'' or theta''' of the motor
//   s.t. D qdd + C qd + g = kappa(phi - q)             (4.1), E4, stated as inverse dynamics
//        phi = Xi^{-1}(theta) + q_offset + phi_shift,  bounds (4.3c), (4.3d), E10
//        at rest at both ends on the reference             (4.3e)-(4.3j), E14
// Everything here is in SI units on the output side of the gears (theta / ratio); nu weighs the true motor
// input, as in the source.
#pragma once

#include "exactarm/base/types.hpp"
#include "exactarm/ocp/layout.hpp"
#include "exactarm/robot/gear.hpp"

namespace exactarm::ocp {

constexpr long kLeastKnots = 12;  // fewer leave no freedom between the two ends

enum class Input { acceleration, jerk };

// Per axis; infinite where there is no limit.
struct Bounds {
  Vector q_min, q_max, q_dot, theta_min, theta_max, theta_dot, theta_ddot, theta_dddot;
};

struct Problem {
  double step = 1e-3;       // s
  double weight = 1e-14;    // nu
  Input input = Input::acceleration;
  RowMatrix q_desired;      // N x n
  RowMatrix direction;      // N x n in [-1, 1]: blend of the gear tables, -1 clockwise; empty: 0
  RowMatrix phi_shift;      // N x n rad, known functions along the reference; empty: 0
  std::vector<Gear> gears;
  std::vector<Spring> springs;   // every axis elastic
  Vector q_offset;
  Bounds bounds;

  int axes() const { return static_cast<int>(springs.size()); }
  long knots() const { return q_desired.rows(); }
  Layout layout() const { return {axes(), input == Input::jerk ? 3 : 2, knots()}; }
};

// Gears, springs, offsets and limits of a robot: E10 on the motor side, theta within the limits of q.
Problem problem_of(const Robot& robot);

// Throws InvalidArgument naming what is wrong.
void require_problem(const Problem& problem);

// Bounds of one knot in the layout's units, (blocks n); infinite for qdd.
void knot_bounds(const Problem& problem, VectorRef low, VectorRef high);

}  // namespace exactarm::ocp
