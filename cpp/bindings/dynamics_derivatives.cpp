#include "exactarm/robot/dynamics_derivatives.hpp"

#include "binding.hpp"

namespace exactarm::bindings {

void bind_dynamics_derivatives(py::module_& module) {
  module.def(
      "inverse_dynamics_derivatives",
      [](const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot, ConstRowMatrixRef q_ddot,
         ConstRowMatrixRef multiplier, int threads) {
        const long rows = q.rows(), n = robot.axes();
        const std::pair<const char*, const ConstRowMatrixRef*> inputs[] = {
            {"q", &q}, {"q_dot", &q_dot}, {"q_ddot", &q_ddot}, {"multiplier", &multiplier}};
        const bool second = multiplier.size() > 0;
        for (const auto& [name, matrix] : inputs) {
          if (matrix == &multiplier && !second) continue;
          require_size(std::string("columns of ") + name, matrix->cols(), n);
          require_size(std::string("rows of ") + name, matrix->rows(), rows);
        }
        const RowMatrix samples[] = {q, q_dot, q_ddot, multiplier};
        KnotBatch batch;
        batch.knots = rows;
        batch.q = samples[0].data();
        batch.q_dot = samples[1].data();
        batch.q_ddot = samples[2].data();
        batch.lambda = second ? samples[3].data() : nullptr;
        py::dict results;
        auto tau = new_array(rows, n);
        batch.tau = tau.mutable_data();
        results["tau"] = tau;
        const std::pair<const char*, double**> outputs[] = {
            {"dtau_dq", &batch.dtau_dq},         {"dtau_dq_dot", &batch.dtau_dq_dot},
            {"mass_matrix", &batch.mass_matrix}, {"q_q", &batch.q_q},
            {"q_q_dot", &batch.q_q_dot},         {"q_dot_q_dot", &batch.q_dot_q_dot},
            {"q_q_ddot", &batch.q_q_ddot}};
        for (int k = 0; k < (second ? 7 : 3); ++k) {
          auto matrix = new_array(rows, n, n);
          *outputs[k].second = matrix.mutable_data();
          results[outputs[k].first] = matrix.attr("swapaxes")(1, 2);  // column major in the core
        }
        {
          const ReleasedGil released;
          inverse_dynamics_knots(DynamicsModel(robot), batch, threads);
        }
        return results;
      },
      py::arg("robot"), py::arg("q"), py::arg("q_dot"), py::arg("q_ddot"),
      py::arg("multiplier") = RowMatrix(), py::arg("threads") = 1,
      "tau (rows, axes), dtau_dq, dtau_dq_dot, mass_matrix (rows, axes, axes); with a multiplier "
      "(rows, axes) also the blocks q_q, q_q_dot, q_dot_q_dot, q_q_ddot of the Hessian of multiplier . tau.");
}

}  // namespace exactarm::bindings
