#include "exactarm/robot/regressor.hpp"

#include "binding.hpp"
#include "exactarm/robot/dynamics_model.hpp"

namespace exactarm::bindings {

void bind_regressor(py::module_& module) {
  module.def(
      "dynamics_regressor",
      [](const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot, ConstRowMatrixRef q_ddot,
         int threads) {
        auto Y = new_array(q.rows(), robot.axes(), kInertialParameters * robot.axes());
        double* out = Y.mutable_data();
        {
          const ReleasedGil released;
          dynamics_regressor_batch(robot, q, q_dot, q_ddot, out, threads);
        }
        return Y;
      },
      py::arg("robot"), py::arg("q"), py::arg("q_dot"), py::arg("q_ddot"), py::arg("threads") = 1,
      "Y (rows, axes, 10 axes) with tau = Y pi; pi a link: m, m c, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about "
      "the origin of the link's DH frame.");

  module.def("inertial_parameters", py::overload_cast<const Robot&>(&inertial_parameters), py::arg("robot"),
             "pi of all links, 10 axes numbers.");
  module.def("link_inertia", &link_inertia, py::arg("parameters"), "LinkInertia of ten inertial parameters.");
}

}  // namespace exactarm::bindings
