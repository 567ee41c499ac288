#include "exactarm/robot/inverse_kinematics.hpp"

#include "binding.hpp"

namespace exactarm::bindings {

void bind_inverse_kinematics(py::module_& module) {
  py::enum_<InverseKinematicsStatus>(module, "InverseKinematicsStatus")
      .value("solved", InverseKinematicsStatus::solved)
      .value("unreachable", InverseKinematicsStatus::unreachable)
      .value("singular", InverseKinematicsStatus::singular)
      .value("joint_limit", InverseKinematicsStatus::joint_limit)
      .value("not_finite", InverseKinematicsStatus::not_finite);

  py::class_<InverseKinematicsOptions>(module, "InverseKinematicsOptions")
      .def(py::init<>())
      .def_readwrite("tolerance", &InverseKinematicsOptions::tolerance)
      .def_readwrite("iterations", &InverseKinematicsOptions::iterations)
      .def_readwrite("singular", &InverseKinematicsOptions::singular)
      .def_readwrite("extrapolate", &InverseKinematicsOptions::extrapolate)
      .def_readwrite("largest_jump", &InverseKinematicsOptions::largest_jump)
      .def_readwrite("check_limits", &InverseKinematicsOptions::check_limits);

  py::class_<InverseKinematicsReport>(module, "InverseKinematicsReport")
      .def_readonly("status", &InverseKinematicsReport::status)
      .def_readonly("index", &InverseKinematicsReport::index)
      .def_readonly("joint", &InverseKinematicsReport::joint)
      .def_readonly("value", &InverseKinematicsReport::value)
      .def_readonly("limit", &InverseKinematicsReport::limit)
      .def_readonly("conditioning", &InverseKinematicsReport::conditioning)
      .def_readonly("conditioning_index", &InverseKinematicsReport::conditioning_index)
      .def_readonly("iterations", &InverseKinematicsReport::iterations);

  module.def(
      "inverse_kinematics_path",
      [](const Robot& robot, ConstRowMatrixRef positions, ConstRowMatrixRef rotations, ConstVectorRef start,
         const InverseKinematicsOptions& options) {
        RowMatrix q;
        InverseKinematicsReport report;
        {
          const ReleasedGil released;
          report = inverse_kinematics_path(robot, positions, rotations, start, q, options);
        }
        return py::make_tuple(q, report);
      },
      py::arg("robot"), py::arg("positions"), py::arg("rotations"), py::arg("start"),
      py::arg("options") = InverseKinematicsOptions(),
      "Joint angles (rows, axes) of poses (rows, 3) in m and (rows, 9) row-major rotations, and a report.");

  module.def("inverse_kinematics_branches", &inverse_kinematics_branches, py::arg("robot"), py::arg("target"),
             py::arg("options") = InverseKinematicsOptions(),
             "All joint angles that reach one pose within the limits, nearest to their middle first.");
}

}  // namespace exactarm::bindings
