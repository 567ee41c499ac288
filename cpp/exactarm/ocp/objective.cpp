#include "exactarm/ocp/objective.hpp"

namespace exactarm::ocp {

Objective::Objective(const Problem& problem)
    : problem_(problem), layout_(problem.layout()), input_weights_(problem.axes()) {
  const double unit = std::pow(problem.step, problem.input == Input::jerk ? 3 : 2);
  for (int i = 0; i < problem.axes(); ++i)
    input_weights_[i] = problem.weight * std::pow(problem.gears[i].ratio / unit, 2);
}

double Objective::value(const double* z) const {
  const int n = layout_.axes, width = layout_.width();
  double sum = 0.0;
  for (long k = 0; k < layout_.knots; ++k)
    for (int i = 0; i < n; ++i) {
      const double error = z[k * width + i] - problem_.q_desired(k, i);
      const double input = z[k * width + layout_.input() * n + i];
      sum += error * error + input_weights_[i] * input * input;
    }
  return sum;
}

void Objective::gradient(const double* z, double* gradient) const {
  const int n = layout_.axes, width = layout_.width();
  std::fill_n(gradient, layout_.unknowns(), 0.0);
  for (long k = 0; k < layout_.knots; ++k)
    for (int i = 0; i < n; ++i) {
      const long q = k * width + i, input = k * width + layout_.input() * n + i;
      gradient[q] = 2.0 * (z[q] - problem_.q_desired(k, i));
      gradient[input] = 2.0 * input_weights_[i] * z[input];
    }
}

Vector Objective::hessian_diagonal(double scale) const {
  const int n = layout_.axes, width = layout_.width();
  Vector diagonal = Vector::Zero(layout_.unknowns());
  for (long k = 0; k < layout_.knots; ++k) {
    diagonal.segment(k * width + kQ * n, n).setConstant(2.0 * scale);
    diagonal.segment(k * width + layout_.input() * n, n) = 2.0 * scale * input_weights_;
  }
  return diagonal;
}

double Objective::natural_scale(const double* z) const {
  return 100.0 / std::max(value(z), 1e-6);
}

double Objective::gradient_floor(double scale) const {
  return 1e-15 * scale * std::max(problem_.q_desired.cwiseAbs().maxCoeff(), 1.0);
}

}  // namespace exactarm::ocp
