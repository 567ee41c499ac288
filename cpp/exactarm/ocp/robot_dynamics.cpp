#include "exactarm/ocp/robot_dynamics.hpp"

namespace exactarm::ocp {

RobotDynamics::RobotDynamics(const Robot& robot) : model_(robot) {}
RobotDynamics::~RobotDynamics() = default;

void RobotDynamics::evaluate(const DynamicsBatch& batch, long first, long last) const {
  std::unique_ptr<KnotWorkspace> workspace;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!idle_.empty()) {
      workspace = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  if (!workspace) workspace = std::make_unique<KnotWorkspace>(model_);
  KnotBatch knots;
  knots.knots = batch.knots;
  knots.q = batch.q;
  knots.q_dot = batch.q_dot;
  knots.q_ddot = batch.q_ddot;
  knots.lambda = batch.lambda;
  knots.tau = batch.tau;
  knots.dtau_dq = batch.by_q;
  knots.dtau_dq_dot = batch.by_q_dot;
  knots.mass_matrix = batch.by_q_ddot;
  knots.q_q = batch.q_q;
  knots.q_q_dot = batch.q_q_dot;
  knots.q_dot_q_dot = batch.q_dot_q_dot;
  knots.q_q_ddot = batch.q_q_ddot;
  inverse_dynamics_knots(model_, *workspace, knots, first, last);
  const std::lock_guard<std::mutex> lock(mutex_);
  idle_.push_back(std::move(workspace));
}

}  // namespace exactarm::ocp
