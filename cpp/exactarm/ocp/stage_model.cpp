#include "exactarm/ocp/stage_model.hpp"

#include "exactarm/base/parallel.hpp"

namespace exactarm::ocp {
namespace {

constexpr long kLeastKnotsAThread = 128;

}  // namespace

StageDerivatives::StageDerivatives(const Layout& layout) {
  const long rows = layout.knots * layout.axes, squares = rows * layout.axes;
  for (Vector* v : {&residual, &by_theta, &q_theta, &theta_theta}) v->setZero(rows);
  for (Vector* v : {&by_q, &by_q_dot, &by_q_ddot, &q_q, &q_q_dot, &q_dot_q_dot, &q_q_ddot})
    v->setZero(squares);
}

StageModel::StageModel(const Problem& problem, const StageDynamics& dynamics, int threads)
    : problem_(problem), dynamics_(dynamics), layout_(problem.layout()), threads_(std::max(threads, 1)) {
  require_problem(problem);
  require_size("axes of the dynamics", dynamics.axes(), layout_.axes);
}

StageWorkspace::StageWorkspace(const StageModel& model) {
  const long rows = model.layout().knots * model.layout().axes;
  for (Vector* v : {&q_, &q_dot_, &q_ddot_, &scaled_lambda_}) v->setZero(rows);
  idle_.reserve(static_cast<std::size_t>(model.threads()));
}

StageWorkspace::OfDynamics StageWorkspace::take(const StageDynamics& dynamics) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!idle_.empty()) {
      OfDynamics workspace = std::move(idle_.back());
      idle_.pop_back();
      return workspace;
    }
  }
  return dynamics.workspace();
}

void StageWorkspace::give_back(OfDynamics workspace) {
  const std::lock_guard<std::mutex> lock(mutex_);
  idle_.push_back(std::move(workspace));
}

double StageModel::shift(long k, int i) const {
  return problem_.q_offset[i] + (problem_.phi_shift.size() > 0 ? problem_.phi_shift(k, i) : 0.0);
}

double StageModel::direction(long k, int i) const {
  return problem_.direction.size() > 0 ? problem_.direction(k, i) : 0.0;
}

double StageModel::motor_angle(long k, int i, double phi) const {
  GearDerivatives xi;
  gear_derivatives(problem_.gears[i], direction(k, i), phi, 0, xi);
  return xi.value[0];
}

StageModel::OutputAngle StageModel::output_angle(long k, int i, double theta) const {
  const Gear& gear = problem_.gears[i];
  if (gear.cw.size() == 0 && gear.ccw.size() == 0) return {theta, 1.0, 0.0};
  const double phi = gear_output_angle(gear, direction(k, i), theta);
  GearDerivatives xi;
  gear_derivatives(gear, direction(k, i), phi, 2, xi);
  const double u = xi.value[1];
  return {phi, 1.0 / u, -xi.value[2] / (u * u * u)};
}

DynamicsBatch StageModel::gather(const double* z, StageWorkspace& w, long first, long last) const {
  const int n = layout_.axes, width = layout_.width();
  const double rate = 1.0 / problem_.step, square = rate * rate;
  for (long k = first; k < last; ++k)
    for (int i = 0; i < n; ++i) {
      const double* knot = z + k * width;
      w.q_[k * n + i] = knot[kQ * n + i];
      w.q_dot_[k * n + i] = rate * knot[kQDot * n + i];
      w.q_ddot_[k * n + i] = square * knot[kQDdot * n + i];
    }
  DynamicsBatch batch;
  batch.knots = layout_.knots;
  batch.q = w.q_.data();
  batch.q_dot = w.q_dot_.data();
  batch.q_ddot = w.q_ddot_.data();
  return batch;
}

void StageModel::residual(const double* z, StageWorkspace& w, double* residual) const {
  const int n = layout_.axes;
  parallel_rows(layout_.knots, threads_, kLeastKnotsAThread, [&](long first, long last) {
    DynamicsBatch batch = gather(z, w, first, last);
    batch.tau = residual;
    StageWorkspace::OfDynamics own = w.take(dynamics_);
    dynamics_.evaluate(batch, first, last, own.get());
    w.give_back(std::move(own));
    for (long k = first; k < last; ++k)
      for (int i = 0; i < n; ++i) {
        const Spring& spring = problem_.springs[i];
        const double theta = z[k * layout_.width() + kTheta * n + i];
        const double e = output_angle(k, i, theta).phi + shift(k, i) - w.q_[k * n + i];
        double& r = residual[k * n + i];
        r = (r - spring.linear * e - spring.cubic * e * e * e) / spring.linear;
      }
  });
}

void StageModel::derivatives(const double* z, const double* lambda, StageWorkspace& w,
                             StageDerivatives& out) const {
  const int n = layout_.axes, n2 = n * n;
  const double rate = 1.0 / problem_.step;
  parallel_rows(layout_.knots, threads_, kLeastKnotsAThread, [&](long first, long last) {
    DynamicsBatch batch = gather(z, w, first, last);
    batch.tau = out.residual.data();
    batch.by_q = out.by_q.data();
    batch.by_q_dot = out.by_q_dot.data();
    batch.by_q_ddot = out.by_q_ddot.data();
    if (lambda) {
      for (long k = first; k < last; ++k)
        for (int i = 0; i < n; ++i)
          w.scaled_lambda_[k * n + i] = lambda[k * n + i] / problem_.springs[i].linear;
      batch.lambda = w.scaled_lambda_.data();
      batch.q_q = out.q_q.data();
      batch.q_q_dot = out.q_q_dot.data();
      batch.q_dot_q_dot = out.q_dot_q_dot.data();
      batch.q_q_ddot = out.q_q_ddot.data();
    }
    StageWorkspace::OfDynamics own = w.take(dynamics_);
    dynamics_.evaluate(batch, first, last, own.get());
    w.give_back(std::move(own));
    for (long k = first; k < last; ++k) {
      for (int i = 0; i < n; ++i) {
        const Spring& spring = problem_.springs[i];
        const double k1 = spring.linear, theta = z[k * layout_.width() + kTheta * n + i];
        const OutputAngle angle = output_angle(k, i, theta);
        const double e = angle.phi + shift(k, i) - w.q_[k * n + i];
        const double slope = 1.0 + 3.0 * spring.cubic / k1 * e * e, curvature = 6.0 * spring.cubic / k1 * e;
        const long row = k * n + i;
        out.residual[row] = out.residual[row] / k1 - e - spring.cubic / k1 * e * e * e;
        for (int j = 0; j < n; ++j) {
          const long entry = k * n2 + j * n + i;
          out.by_q[entry] /= k1;
          out.by_q_dot[entry] *= rate / k1;
          out.by_q_ddot[entry] *= rate * rate / k1;
        }
        out.by_q[k * n2 + i * n + i] += slope;
        out.by_theta[row] = -slope * angle.first;
        if (!lambda) continue;
        const double l = lambda[row];
        out.q_q[k * n2 + i * n + i] -= l * curvature;
        out.q_theta[row] = l * curvature * angle.first;
        out.theta_theta[row] = -l * (curvature * angle.first * angle.first + slope * angle.second);
      }
      if (!lambda) continue;
      for (long entry = k * n2; entry < (k + 1) * n2; ++entry) {
        out.q_q_dot[entry] *= rate;
        out.q_dot_q_dot[entry] *= rate * rate;
        out.q_q_ddot[entry] *= rate * rate;
      }
    }
  });
}

}  // namespace exactarm::ocp
