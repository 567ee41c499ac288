#include "exactarm/ocp/initial_guess.hpp"

#include "exactarm/robot/elasticity.hpp"

namespace exactarm::ocp {
namespace {

// theta (output side) that holds torque tau at link angle q.
double holding_angle(const StageModel& model, long k, int i, double q, double tau) {
  const double e = spring_deflection(model.problem().springs[i], tau);
  return model.motor_angle(k, i, q - model.shift(k, i) + e);
}

}  // namespace

void differences(const double* samples, long rows, int columns, long stride, int order, double* out,
                 long out_stride) {
  // Central weights for offsets -2..2 (three terms where a neighbour is missing); the ends are left at 0.
  static const double kFive[3][5] = {{1. / 12, -8. / 12, 0, 8. / 12, -1. / 12},
                                     {-1. / 12, 16. / 12, -30. / 12, 16. / 12, -1. / 12},
                                     {-0.5, 1, 0, -1, 0.5}};
  static const double kThree[2][3] = {{-0.5, 0, 0.5}, {1, -2, 1}};
  for (long k = 0; k < rows; ++k)
    for (int c = 0; c < columns; ++c) {
      const auto at = [&](long row) { return samples[row * stride + c]; };
      double sum = 0.0;
      if (k >= 2 && k < rows - 2)
        for (int o = -2; o <= 2; ++o) sum += kFive[order - 1][o + 2] * at(k + o);
      else if (order < 3 && k >= 1 && k < rows - 1)
        for (int o = -1; o <= 1; ++o) sum += kThree[order - 1][o + 1] * at(k + o);
      out[k * out_stride + c] = sum;
    }
}

void rest(const StageModel& model, long knot, double* z_k) {
  const Layout& layout = model.layout();
  const int n = layout.axes;
  Vector q = model.problem().q_desired.row(knot).transpose(), zero = Vector::Zero(n), tau(n);
  DynamicsBatch batch;
  batch.knots = 1;
  batch.q = q.data();
  batch.q_dot = batch.q_ddot = zero.data();
  batch.tau = tau.data();
  model.dynamics().evaluate(batch, 0, 1, model.dynamics().workspace().get());
  std::fill(z_k, z_k + layout.width(), 0.0);
  for (int i = 0; i < n; ++i) {
    z_k[kQ * n + i] = q[i];
    z_k[kTheta * n + i] = holding_angle(model, knot, i, q[i], tau[i]);
  }
}

void initial_guess(const StageModel& model, double* z) {
  const Layout& layout = model.layout();
  const int n = layout.axes, width = layout.width();
  const long rows = layout.knots;
  const RowMatrix& q = model.problem().q_desired;
  std::fill(z, z + layout.unknowns(), 0.0);
  for (long k = 0; k < rows; ++k)
    for (int i = 0; i < n; ++i) z[k * width + kQ * n + i] = q(k, i);
  differences(z + kQ * n, rows, n, width, 1, z + kQDot * n, width);
  differences(z + kQ * n, rows, n, width, 2, z + kQDdot * n, width);
  // With theta chosen so that phi - q + shift = 0 the residual is tau / k1.
  Vector tau(rows * n);
  for (long k = 0; k < rows; ++k)
    for (int i = 0; i < n; ++i)
      z[k * width + kTheta * n + i] = model.motor_angle(k, i, q(k, i) - model.shift(k, i));
  StageWorkspace workspace(model);
  model.residual(z, workspace, tau.data());
  for (long k = 0; k < rows; ++k)
    for (int i = 0; i < n; ++i)
      z[k * width + kTheta * n + i] =
          holding_angle(model, k, i, q(k, i), tau[k * n + i] * model.problem().springs[i].linear);
  rest(model, 0, z);
  rest(model, rows - 1, z + (rows - 1) * width);
  for (int order = 1; order <= layout.motor_order; ++order)
    differences(z + kTheta * n, rows, n, width, order, z + (kTheta + order) * n, width);
}

}  // namespace exactarm::ocp
