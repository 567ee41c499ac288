// The rigid link-side dynamics of a robot (inverse_dynamics) behind the planner's interface.
#pragma once

#include <mutex>

#include "exactarm/ocp/stage_dynamics.hpp"
#include "exactarm/robot/dynamics_derivatives.hpp"

namespace exactarm::ocp {

class RobotDynamics : public StageDynamics {
 public:
  explicit RobotDynamics(const Robot& robot);
  ~RobotDynamics() override;
  int axes() const override { return model_.size(); }
  void evaluate(const DynamicsBatch& batch, long first, long last) const override;

 private:
  DynamicsModel model_;
  // Workspaces that no thread uses at the moment; grows to the number of threads, then never again.
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<KnotWorkspace>> idle_;
};

}  // namespace exactarm::ocp
