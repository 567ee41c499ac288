// Small optimal control problems for the planner's tests: a closed-form two-link arm, single linear
// masses, and smooth random references.
#pragma once

#include "exactarm/ocp/problem.hpp"
#include "exactarm/ocp/stage_dynamics.hpp"
#include "random_states.hpp"

namespace exactarm::testing {

// Masses that move along a line each: tau = m qdd.
class LinearMasses : public ocp::StageDynamics {
 public:
  explicit LinearMasses(Vector mass) : mass_(std::move(mass)) {}
  int axes() const override { return static_cast<int>(mass_.size()); }
  void evaluate(const ocp::DynamicsBatch& b, long first, long last, Workspace*) const override {
    const int n = axes();
    for (long k = first; k < last; ++k) {
      for (double* out : {b.by_q, b.by_q_dot, b.by_q_ddot, b.q_q, b.q_q_dot, b.q_dot_q_dot, b.q_q_ddot})
        if (out) std::fill(out + k * n * n, out + (k + 1) * n * n, 0.0);
      for (int i = 0; i < n; ++i) {
        if (b.tau) b.tau[k * n + i] = mass_[i] * b.q_ddot[k * n + i];
        if (b.by_q_ddot) b.by_q_ddot[k * n * n + i * n + i] = mass_[i];
      }
    }
  }

 private:
  Vector mass_;
};

// Order-7 motion between two points (E9) with a smooth random bump that is at rest at both ends.
inline RowMatrix random_reference(Random& random, long knots, const Vector& from, const Vector& to,
                                  double bump) {
  RowMatrix q(knots, from.size());
  const Vector size = random.vector(from.size(), bump);
  for (long k = 0; k < knots; ++k) {
    const double t = k / (knots - 1.0), s = t * t * t * t * (35 + t * (-84 + t * (70 - 20 * t)));
    q.row(k) = (from + (to - from) * s + size * std::pow(4.0 * s * (1.0 - s), 3)).transpose();
  }
  return q;
}

inline ocp::Problem mass_problem(const RowMatrix& q_desired, double step, double weight) {
  const long n = q_desired.cols();
  Joint joint;
  joint.gear.ratio = 50.0;
  joint.spring = {2e4, 0.0};
  RobotDescription robot;
  robot.joints.assign(n, joint);
  ocp::Problem problem = ocp::problem_of(robot);
  problem.q_desired = q_desired;
  problem.step = step;
  problem.weight = weight;
  return problem;
}

}  // namespace exactarm::testing
