// The rigid link-side dynamics of a robot (inverse_dynamics) behind the planner's interface.
#pragma once

#include "exactarm/ocp/stage_dynamics.hpp"
#include "exactarm/robot/dynamics_derivatives.hpp"

namespace exactarm::ocp {

class RobotDynamics : public StageDynamics {
 public:
  explicit RobotDynamics(const Robot& robot);
  int axes() const override { return model_.size(); }
  std::unique_ptr<Workspace> workspace() const override;
  void evaluate(const DynamicsBatch& batch, long first, long last, Workspace* workspace) const override;

 private:
  DynamicsModel model_;
};

}  // namespace exactarm::ocp
