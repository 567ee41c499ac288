#include "exactarm/ocp/barrier.hpp"

namespace exactarm::ocp {
namespace {

constexpr double kFar = 1e20;

double longest(const Vector& value, const Vector& step, double share) {
  double alpha = 1.0;
  for (long i = 0; i < value.size(); ++i)
    if (step[i] < 0.0) alpha = std::min(alpha, -(1.0 - share) * value[i] / step[i]);
  return alpha;
}

}  // namespace

Barrier::Barrier(Vector low, Vector high) : low_(std::move(low)), high_(std::move(high)) {
  low_ = low_.cwiseMax(-kFar);
  high_ = high_.cwiseMin(kFar);
  finite_low_ = (low_.array() > -0.1 * kFar).cast<double>();
  finite_high_ = (high_.array() < 0.1 * kFar).cast<double>();
  count_ = std::max(finite_low_.sum() + finite_high_.sum(), 1.0);
  for (Vector* v : {&s_low_, &s_high_, &y_low_, &y_high_, &ds_low_, &ds_high_, &dy_low_, &dy_high_,
                    &product_low_, &product_high_})
    v->setZero(low_.size());
}

bool Barrier::start(const Vector& z, double barrier) {
  // With one side missing the size of the other stands for the range.
  bool inside = true;
  for (long i = 0; i < z.size(); ++i) {
    const bool both = finite_low_[i] != 0.0 && finite_high_[i] != 0.0;
    const double one = finite_low_[i] != 0.0 ? low_[i] : finite_high_[i] != 0.0 ? high_[i] : 1.0;
    const double least = 0.01 * (both ? high_[i] - low_[i] : std::max(std::abs(one), 1e-12));
    inside = inside && z[i] - low_[i] >= least && high_[i] - z[i] >= least;
    s_low_[i] = std::max(z[i] - low_[i], least);
    s_high_[i] = std::max(high_[i] - z[i], least);
    y_low_[i] = barrier / s_low_[i];
    y_high_[i] = barrier / s_high_[i];
  }
  return inside;
}

void Barrier::add_diagonal(Vector& diagonal) const {
  diagonal.array() += y_low_.array() / s_low_.array() + y_high_.array() / s_high_.array();
}

void Barrier::add_gradient(const Vector& z, double tau, bool corrected, Vector& gradient) const {
  const auto s_low = s_low_.array(), s_high = s_high_.array();
  gradient.array() += (-tau + y_low_.array() * (z - low_ - s_low_).array()) / s_low;
  gradient.array() += (tau - y_high_.array() * (high_ - z - s_high_).array()) / s_high;
  if (corrected) gradient.array() += product_low_.array() / s_low - product_high_.array() / s_high;
}

void Barrier::set_step(const Vector& z, const Vector& dz, double tau, bool corrected) {
  ds_low_ = dz + (z - low_ - s_low_);
  ds_high_ = (high_ - z - s_high_) - dz;
  const double keep = corrected ? 1.0 : 0.0;
  dy_low_ = (tau - keep * product_low_.array() - y_low_.array() * ds_low_.array()) / s_low_.array() -
            y_low_.array();
  dy_high_ = (tau - keep * product_high_.array() - y_high_.array() * ds_high_.array()) / s_high_.array() -
             y_high_.array();
}

void Barrier::keep_products() {
  product_low_ = ds_low_.cwiseProduct(dy_low_);
  product_high_ = ds_high_.cwiseProduct(dy_high_);
}

void Barrier::longest_steps(double share, double& primal, double& dual) const {
  primal = std::min(longest(s_low_, ds_low_, share), longest(s_high_, ds_high_, share));
  dual = std::min(longest(y_low_, dy_low_, share), longest(y_high_, dy_high_, share));
}

void Barrier::move(double primal, double dual) {
  s_low_ += primal * ds_low_;
  s_high_ += primal * ds_high_;
  y_low_ += dual * dy_low_;
  y_high_ += dual * dy_high_;
}

double Barrier::average() const {
  return ((finite_low_ * s_low_.array() * y_low_.array()).sum() +
          (finite_high_ * s_high_.array() * y_high_.array()).sum()) / count_;
}

double Barrier::average_after(double primal, double dual) const {
  const auto sum = [&](const Eigen::ArrayXd& finite, const Vector& s, const Vector& ds, const Vector& y,
                       const Vector& dy) {
    return (finite * (s + primal * ds).array() * (y + dual * dy).array()).sum();
  };
  return (sum(finite_low_, s_low_, ds_low_, y_low_, dy_low_) +
          sum(finite_high_, s_high_, ds_high_, y_high_, dy_high_)) /
         count_;
}

double Barrier::largest_product() const {
  return std::max((finite_low_ * s_low_.array() * y_low_.array()).maxCoeff(),
                  (finite_high_ * s_high_.array() * y_high_.array()).maxCoeff());
}

double Barrier::largest_multiplier() const {
  return std::max((finite_low_ * y_low_.array()).maxCoeff(), (finite_high_ * y_high_.array()).maxCoeff());
}

double Barrier::violation(const Vector& z, long& index, bool& at_low) const {
  long below = 0, above = 0;
  const double low = (low_ - z).maxCoeff(&below), high = (z - high_).maxCoeff(&above);
  at_low = low >= high;
  index = at_low ? below : above;
  return std::max(std::max(low, high), 0.0);
}

void Barrier::add_multipliers(Vector& stationarity) const {
  stationarity.array() += finite_high_ * y_high_.array() - finite_low_ * y_low_.array();
}

}  // namespace exactarm::ocp
