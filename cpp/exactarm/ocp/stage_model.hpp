// The equation of motion at every knot, with first and contracted second derivatives:
//   r_k = (tau(q, qd, qdd) - kappa(e)) / k1,   e = phi + q_offset + phi_shift - q,   phi = Xi_k^{-1}(theta)
// one equation an axis, divided by the spring's linear stiffness, so in rad. Xi_k blends the two tables of
// the gear by the direction at knot k. Derivatives with respect to z_k in the units of Layout.
// Matrices n x n column major, one knot after the other. Knots are spread over threads. The model is never
// written to; what an evaluation needs on its way is a StageWorkspace,
// after whose first use nothing is allocated.
#pragma once

#include <mutex>
#include <vector>

#include "exactarm/ocp/problem.hpp"
#include "exactarm/ocp/stage_dynamics.hpp"

namespace exactarm::ocp {

struct StageDerivatives {
  explicit StageDerivatives(const Layout& layout);
  Vector residual;                               // N n
  Vector by_q, by_q_dot, by_q_ddot;              // N n n
  Vector by_theta;                               // N n, diagonal
  // Of lambda' r.
  Vector q_q, q_q_dot, q_dot_q_dot, q_q_ddot;    // N n n
  Vector q_theta, theta_theta;                   // N n, diagonal
};

class StageModel;

// Of one evaluation at a time.
class StageWorkspace {
 public:
  explicit StageWorkspace(const StageModel& model);

 private:
  friend class StageModel;
  using OfDynamics = std::unique_ptr<StageDynamics::Workspace>;
  OfDynamics take(const StageDynamics& dynamics);
  void give_back(OfDynamics workspace);

  Vector q_, q_dot_, q_ddot_, scaled_lambda_;  // N n
  // Those that no thread uses at the moment; as many as threads have worked at once.
  std::mutex mutex_;
  std::vector<OfDynamics> idle_;
};

class StageModel {
 public:
  StageModel(const Problem& problem, const StageDynamics& dynamics, int threads);

  const Problem& problem() const { return problem_; }
  const Layout& layout() const { return layout_; }
  int threads() const { return threads_; }

  // z: N x (blocks n).
  void residual(const double* z, StageWorkspace& workspace, double* residual) const;
  // lambda null: no second derivatives.
  void derivatives(const double* z, const double* lambda, StageWorkspace& workspace,
                   StageDerivatives& out) const;

  // Gear: output angle and its first two derivatives with respect to theta (output side), knot k, axis i.
  struct OutputAngle {
    double phi, first, second;
  };
  OutputAngle output_angle(long k, int i, double theta) const;
  // theta (output side) of an output angle.
  double motor_angle(long k, int i, double phi) const;
  double shift(long k, int i) const;      // q_offset + phi_shift
  double direction(long k, int i) const;  // blend of the gear tables
  const StageDynamics& dynamics() const { return dynamics_; }

 private:
  DynamicsBatch gather(const double* z, StageWorkspace& workspace, long first, long last) const;

  const Problem& problem_;
  const StageDynamics& dynamics_;
  Layout layout_;
  int threads_;
};

}  // namespace exactarm::ocp
