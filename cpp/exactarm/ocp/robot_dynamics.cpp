#include "exactarm/ocp/robot_dynamics.hpp"

namespace exactarm::ocp {

namespace {

struct OfKnots : StageDynamics::Workspace {
  explicit OfKnots(const DynamicsModel& model) : knots(model) {}
  KnotWorkspace knots;
};

}  // namespace

RobotDynamics::RobotDynamics(const Robot& robot) : model_(robot) {}

std::unique_ptr<StageDynamics::Workspace> RobotDynamics::workspace() const {
  return std::make_unique<OfKnots>(model_);
}

void RobotDynamics::evaluate(const DynamicsBatch& batch, long first, long last, Workspace* workspace) const {
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
  inverse_dynamics_knots(model_, static_cast<OfKnots*>(workspace)->knots, knots, first, last);
}

}  // namespace exactarm::ocp
