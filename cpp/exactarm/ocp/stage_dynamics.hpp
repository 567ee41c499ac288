// The link-side dynamics as the planner needs them: tau(q, qd, qdd), its first derivatives, and the
// second derivatives of lambda' tau, many knots at a time. Inputs n numbers a knot, outputs n or n x n
// (column major) a knot; an output that is null is not wanted. SI units.
#pragma once

#include <memory>

#include "exactarm/robot/robot.hpp"

namespace exactarm::ocp {

struct DynamicsBatch {
  long knots = 0;
  const double *q = nullptr, *q_dot = nullptr, *q_ddot = nullptr;
  const double* lambda = nullptr;  // null: no second derivatives
  double *tau = nullptr, *by_q = nullptr, *by_q_dot = nullptr, *by_q_ddot = nullptr;
  // Second derivatives of lambda' tau; q_q_dot(i, j) = d2 / dq_i dqd_j. The other pairs are zero.
  double *q_q = nullptr, *q_q_dot = nullptr, *q_dot_q_dot = nullptr, *q_q_ddot = nullptr;
};

class StageDynamics {
 public:
  virtual ~StageDynamics() = default;
  virtual int axes() const = 0;

  // What an evaluation writes on its way; each thread needs its own.
  class Workspace {
   public:
    virtual ~Workspace() = default;
  };
  virtual std::unique_ptr<Workspace> workspace() const { return nullptr; }

  // Knots [first, last); called from several threads at once, each with a workspace of workspace().
  virtual void evaluate(const DynamicsBatch& batch, long first, long last, Workspace* workspace) const = 0;
};

}  // namespace exactarm::ocp
