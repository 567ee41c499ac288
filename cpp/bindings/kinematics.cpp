#include "exactarm/robot/kinematics.hpp"

#include "binding.hpp"

namespace exactarm::bindings {

void bind_kinematics(py::module_& module) {
  module.def("identification_columns", &identification_columns, py::arg("axes"));

  module.def(
      "identification_layout",
      [](long axes) {
        const long base = identification_columns(axes) - 2 * kPlacementParameters;
        const auto of_each_frame = [&](FrameParameter k) { return py::slice(k, base, kFrameParameters); };
        const auto placement = [](long first) { return py::slice(first, first + kPlacementParameters, 1); };
        return std::map<std::string, py::slice>{
            {"d", of_each_frame(kD)},         {"a", of_each_frame(kA)},
            {"alpha", of_each_frame(kAlpha)}, {"beta", of_each_frame(kBeta)},
            {"q", of_each_frame(kQ)},         {"ratio", of_each_frame(kRatio)},
            {"base", placement(base)},        {"tool", placement(base + kPlacementParameters)},
        };
      },
      py::arg("axes"), "Columns of the identification Jacobian by what they are derivatives by.");

  module.def(
      "forward_kinematics",
      [](const Robot& robot, ConstRowMatrixRef q, int threads) {
        auto position = new_array(q.rows(), 3), rotation = new_array(q.rows(), 3, 3);
        KinematicsBatch out;
        out.position = position.mutable_data();
        out.rotation = rotation.mutable_data();
        {
          const ReleasedGil released;
          kinematics_batch(robot, q, RowMatrix(), out, threads);
        }
        return py::make_tuple(position, rotation);
      },
      py::arg("robot"), py::arg("q"), py::arg("threads") = 1,
      "Positions (rows, 3) in m and rotations (rows, 3, 3) of the target in the measuring frame.");

  module.def(
      "geometric_jacobian",
      [](const Robot& robot, ConstRowMatrixRef q, int threads) {
        auto jacobian = new_array(q.rows(), 6, robot.axes());
        KinematicsBatch out;
        out.jacobian = jacobian.mutable_data();
        {
          const ReleasedGil released;
          kinematics_batch(robot, q, RowMatrix(), out, threads);
        }
        return jacobian;
      },
      py::arg("robot"), py::arg("q"), py::arg("threads") = 1,
      "Geometric Jacobians (rows, 6, axes): linear rows, then angular rows.");

  module.def(
      "identification_jacobian",
      [](const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef dq_dratio, int threads) {
        auto position = new_array(q.rows(), 3), rotation = new_array(q.rows(), 3, 3);
        auto jacobian = new_array(q.rows(), 6, identification_columns(robot.axes()));
        KinematicsBatch out;
        out.position = position.mutable_data();
        out.rotation = rotation.mutable_data();
        out.identification = jacobian.mutable_data();
        {
          const ReleasedGil released;
          kinematics_batch(robot, q, dq_dratio, out, threads);
        }
        return py::make_tuple(position, rotation, jacobian);
      },
      py::arg("robot"), py::arg("q"), py::arg("dq_dratio") = RowMatrix(), py::arg("threads") = 1,
      "Positions, rotations and identification Jacobians (rows, 6, columns): per axis d, a, alpha, beta, q, "
      "ratio, then base (translation, rotation) and tool (translation, rotation).");

  module.def(
      "frame_poses",
      [](const Robot& robot, ConstRowMatrixRef q) {
        const long n = robot.axes();
        auto position = new_array(q.rows(), n + 1, 3), rotation = new_array(q.rows(), n + 1, 3, 3);
        std::vector<Pose> poses;
        for (long row = 0; row < q.rows(); ++row) {
          frame_poses(robot, q.row(row).transpose(), poses);
          for (long i = 0; i <= n; ++i) {
            Eigen::Map<Vector3>(position.mutable_data(row, i, 0)) = poses[i].position;
            Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation.mutable_data(row, i, 0, 0)) =
                poses[i].rotation;
          }
        }
        return py::make_tuple(position, rotation);
      },
      py::arg("robot"), py::arg("q"),
      "Positions (rows, axes + 1, 3) and rotations (rows, axes + 1, 3, 3) of base and frames 1..n.");
}

}  // namespace exactarm::bindings
