// Slacks and multipliers of the bounds of all unknowns, one pair a side:
//   z - low = s_low,  high - z = s_high,  s y = tau
// Eliminated from the Newton system they add y / s to its diagonal. A missing bound stands at 1e20, where
// its terms vanish by themselves.
#pragma once

#include "exactarm/base/types.hpp"

namespace exactarm::ocp {

class Barrier {
 public:
  // Bounds beyond 1e19 count as missing.
  Barrier(Vector low, Vector high);

  // Slacks of z, at least a hundredth of the range; multipliers barrier / s. Whether z lay that far inside.
  bool start(const Vector& z, double barrier);

  // diagonal += y / s;  gradient += what the slacks leave of the stationarity for target tau.
  void add_diagonal(Vector& diagonal) const;
  void add_gradient(const Vector& z, double tau, bool corrected, Vector& gradient) const;
  // Steps of slacks and multipliers for dz; kept inside.
  void set_step(const Vector& z, const Vector& dz, double tau, bool corrected);
  // Keeps the products of the present step for the corrector.
  void keep_products();
  // Largest steps that leave `share` of every slack (multiplier).
  void longest_steps(double share, double& primal, double& dual) const;
  void move(double primal, double dual);

  double average() const;                          // of s y over the bounds that exist
  double average_after(double primal, double dual) const;
  double largest_product() const;
  double largest_multiplier() const;
  // Largest violation, and where.
  double violation(const Vector& z, long& index, bool& at_low) const;
  const Vector& low() const { return low_; }
  const Vector& high() const { return high_; }
  // Multipliers, 0 where there is no bound.
  Vector low_multipliers() const { return finite_low_ * y_low_.array(); }
  Vector high_multipliers() const { return finite_high_ * y_high_.array(); }
  void add_multipliers(Vector& stationarity) const;

 private:
  Vector low_, high_, s_low_, s_high_, y_low_, y_high_;
  Vector ds_low_, ds_high_, dy_low_, dy_high_, product_low_, product_high_;
  Eigen::ArrayXd finite_low_, finite_high_;
  double count_ = 0.0;
};

}  // namespace exactarm::ocp
