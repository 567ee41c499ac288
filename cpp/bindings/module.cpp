#include "binding.hpp"

PYBIND11_MODULE(_core, module) {
  using namespace exactarm::bindings;
  module.doc() = "Compiled core of exactarm: SI units and radians throughout.";
  bind_interrupt(module);
  bind_robot(module);
  bind_kinematics(module);
  bind_dynamics(module);
  bind_dynamics_derivatives(module);
  bind_elastic_joint_dynamics(module);
  bind_regressor(module);
  bind_gear(module);
  bind_harmonics(module);
  bind_gear_profile(module);
  bind_signals(module);
  bind_blocks(module);
  bind_inverse_kinematics(module);
  bind_solution(module);
}
