// How the unknowns of one knot lie in memory. Time is counted in samples, so that every block is in
// rad and of one size: with the sample time h,
//   z_k = (q, h qd, h^2 qdd, theta, h thetad, [h^2 thetadd,] input)     blocks of n, one knot after the other
// theta is the motor angle divided by the gear's ratio (output side). The input is h^2 thetadd, or with
// jerk as the input h^3 theta'''. States are all blocks but qdd and the input.
#pragma once

namespace exactarm::ocp {

constexpr int kLinkOrder = 2;    // q, qd are states, qdd is algebraic
enum Block { kQ = 0, kQDot = 1, kQDdot = 2, kTheta = 3, kThetaDot = 4, kThetaDdot = 5 };

struct Layout {
  int axes = 0;
  int motor_order = 2;           // 2: acceleration is the input, 3: jerk
  long knots = 0;

  int input() const { return kTheta + motor_order; }          // block of the input
  int blocks() const { return kTheta + motor_order + 1; }
  int state_blocks() const { return kLinkOrder + motor_order; }
  int width() const { return blocks() * axes; }               // unknowns a knot
  int states() const { return state_blocks() * axes; }
  long unknowns() const { return knots * width(); }
  // Block of z that holds state block s.
  static int state_block(int s) { return s < kLinkOrder ? s : s + 1; }
};

}  // namespace exactarm::ocp
