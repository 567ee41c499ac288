#include "exactarm/ocp/first_order.hpp"

#include <algorithm>
#include <limits>

namespace exactarm::ocp {
namespace {

// Roundings of a sum of some ten terms of one size.
constexpr double kRoundings = 4.0 * std::numeric_limits<double>::epsilon();

// A plain maxCoeff may pass over what is not a number.
double largest(const Vector& v) { return v.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(); }

}  // namespace

FirstOrder::FirstOrder(const StageModel& model, const Objective& objective, double scale)
    : objective_(objective),
      layout_(model.layout()),
      scale_(scale),
      residual_(layout_),
      gradient_(layout_.unknowns()),
      stationarity_(layout_.unknowns()) {}

void FirstOrder::evaluate(const KktVector& point, const StageDerivatives& derivatives,
                          const Barrier& barrier) {
  residual_.stage = derivatives.residual;
  objective_.gradient(point.z.data(), gradient_.data());
  gradient_ *= scale_;
  residual_.z = gradient_;
  largest_term_ = point.defect.cwiseAbs().maxCoeff();
  for (long k = 0; k < layout_.knots; ++k) {
    add_equation_of_motion(point, derivatives, k);
    if (k + 1 < layout_.knots) add_defects(point, k);
  }
  stationarity_ = residual_.z;
  barrier.add_multipliers(stationarity_);
  // The ends are fixed, but for the acceleration of the links.
  const int n = layout_.axes, width = layout_.width();
  for (long k : {0L, layout_.knots - 1})
    for (int i = 0; i < width; ++i)
      if (i / n != kQDdot) stationarity_[k * width + i] = 0.0;
}

void FirstOrder::add_equation_of_motion(const KktVector& point, const StageDerivatives& derivatives,
                                        long k) {
  const int n = layout_.axes, n2 = n * n;
  using Square = Eigen::Map<const Matrix>;
  const Square by_q(&derivatives.by_q[k * n2], n, n), by_rate(&derivatives.by_q_dot[k * n2], n, n),
      by_qdd(&derivatives.by_q_ddot[k * n2], n, n);
  const double* lambda = &point.stage[k * n];
  const double entries =
      std::max({by_q.cwiseAbs().maxCoeff(), by_rate.cwiseAbs().maxCoeff(), by_qdd.cwiseAbs().maxCoeff()});
  largest_term_ = std::max(largest_term_, entries * point.stage.segment(k * n, n).cwiseAbs().maxCoeff());
  double* out = &residual_.z[k * layout_.width()];
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      out[j] += by_q(i, j) * lambda[i];
      out[n + j] += by_rate(i, j) * lambda[i];
      out[2 * n + j] += by_qdd(i, j) * lambda[i];
    }
    out[kTheta * n + j] += derivatives.by_theta[k * n + j] * lambda[j];
  }
}

void FirstOrder::add_defects(const KktVector& point, long k) {
  const int n = layout_.axes, width = layout_.width(), s = layout_.states();
  const Vector& z = point.z;
  Vector& lagrangian = residual_.z;
  for (int b = 0; b < layout_.state_blocks(); ++b)
    for (int i = 0; i < n; ++i) {
      const long here = k * width + Layout::state_block(b) * n + i, there = here + width;
      residual_.defect[k * s + b * n + i] = z[there] - z[here] - 0.5 * (z[here + n] + z[there + n]);
      const double pi = point.defect[k * s + b * n + i];
      lagrangian[there] += pi;
      lagrangian[here] -= pi;
      lagrangian[here + n] -= 0.5 * pi;
      lagrangian[there + n] -= 0.5 * pi;
    }
}

double FirstOrder::stationarity() const { return largest(stationarity_); }

double FirstOrder::largest_equation() const {
  const double stage = largest(residual_.stage), defect = largest(residual_.defect);
  return std::isnan(stage) ? stage : std::isnan(defect) ? defect : std::max(stage, defect);
}

double FirstOrder::rounding() const {
  return std::max(objective_.gradient_floor(scale_), kRoundings * largest_term_);
}

double FirstOrder::owed(const KktVector& point) const {
  return std::abs(residual_.stage.dot(point.stage) + residual_.defect.dot(point.defect));
}

}  // namespace exactarm::ocp
