// The objective (4.3a) in the layout's units:
// sum_k |q_k - q_d,k|^2 + weight |input_k|^2, weight = nu ratio^2.
#pragma once

#include "exactarm/ocp/problem.hpp"

namespace exactarm::ocp {

class Objective {
 public:
  explicit Objective(const Problem& problem);
  double value(const double* z) const;
  void gradient(const double* z, double* gradient) const;
  const Vector& input_weights() const { return input_weights_; }  // n
  Vector hessian_diagonal(double scale) const;                    // the whole Hessian of scale f

  // The scale that makes the objective at z 100, at most 1e8: solvers have absolute tolerances.
  double natural_scale(const double* z) const;
  // The gradient 2 scale (q - q_d) cannot be told from 0 below the rounding of q.
  double gradient_floor(double scale) const;

 private:
  const Problem& problem_;
  Layout layout_;
  Vector input_weights_;
};

}  // namespace exactarm::ocp
