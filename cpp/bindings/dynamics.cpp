#include "exactarm/robot/dynamics.hpp"

#include "binding.hpp"

namespace exactarm::bindings {

void bind_dynamics(py::module_& module) {
  module.def(
      "inverse_dynamics",
      [](const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot, ConstRowMatrixRef q_ddot,
         int threads) {
        auto tau = new_array(q.rows(), robot.axes());
        double* out = tau.mutable_data();
        {
          const ReleasedGil released;
          inverse_dynamics_batch(DynamicsModel(robot), q, q_dot, q_ddot, out, threads);
        }
        return tau;
      },
      py::arg("robot"), py::arg("q"), py::arg("q_dot"), py::arg("q_ddot"), py::arg("threads") = 1,
      "Joint torques (rows, axes) in Nm: D qdd + C qd + g, link side, without friction.");

  module.def(
      "gravity_torque",
      [](const Robot& robot, ConstRowMatrixRef q, int threads) {
        auto tau = new_array(q.rows(), robot.axes());
        double* out = tau.mutable_data();
        {
          const ReleasedGil released;
          gravity_torque_batch(DynamicsModel(robot), q, out, threads);
        }
        return tau;
      },
      py::arg("robot"), py::arg("q"), py::arg("threads") = 1,
      "Torques g(q) that hold the robot, (rows, axes) in Nm.");

  module.def(
      "gravity_torque_jacobian",
      [](const Robot& robot, ConstRowMatrixRef q, int threads) {
        auto jacobian = new_array(q.rows(), robot.axes(), robot.axes());
        double* out = jacobian.mutable_data();
        {
          const ReleasedGil released;
          gravity_torque_jacobian_batch(DynamicsModel(robot), q, out, threads);
        }
        return jacobian;
      },
      py::arg("robot"), py::arg("q"), py::arg("threads") = 1, "dg/dq, (rows, axes, axes).");

  module.def(
      "mass_matrix",
      [](const Robot& robot, ConstRowMatrixRef q, int threads) {
        auto D = new_array(q.rows(), robot.axes(), robot.axes());
        double* out = D.mutable_data();
        {
          const ReleasedGil released;
          mass_matrix_batch(DynamicsModel(robot), q, out, threads);
        }
        return D;
      },
      py::arg("robot"), py::arg("q"), py::arg("threads") = 1, "Mass matrices D(q), (rows, axes, axes).");
}

}  // namespace exactarm::bindings
