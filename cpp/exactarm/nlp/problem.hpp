// A nonlinear program with sparse derivatives; knows nothing of robots.
//   min f(x)   s.t.   x_low <= x <= x_high,   c_low <= c(x) <= c_high
// Lagrangian: objective_factor f + lambda' c. Equal bounds fix a variable or make an equality.
// Implementations may keep work space: one problem object serves one thread.
#pragma once

#include <vector>

#include "exactarm/base/types.hpp"

namespace exactarm::nlp {

// Positions of the nonzeros, in the order in which the values are written. Each position once.
struct Sparsity {
  std::vector<int> row, column;
  long size() const { return static_cast<long>(row.size()); }
};

class Problem {
 public:
  virtual ~Problem() = default;
  virtual long variables() const = 0;
  virtual long constraints() const = 0;
  virtual void variable_bounds(VectorRef low, VectorRef high) const = 0;
  virtual void constraint_bounds(VectorRef low, VectorRef high) const = 0;
  virtual void start(VectorRef x) const = 0;
  virtual double objective(ConstVectorRef x) = 0;
  virtual void gradient(ConstVectorRef x, VectorRef gradient) = 0;
  virtual void constraint(ConstVectorRef x, VectorRef c) = 0;
  virtual const Sparsity& jacobian_sparsity() const = 0;
  virtual void jacobian(ConstVectorRef x, double* values) = 0;
  // Lower triangle (row >= column).
  virtual const Sparsity& hessian_sparsity() const = 0;
  virtual void hessian(ConstVectorRef x, double objective_factor, ConstVectorRef lambda, double* values) = 0;
};

}  // namespace exactarm::nlp
