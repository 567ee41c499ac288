// The optimal control problem as a sparse nonlinear program by the trapezoidal rule, thesis (4.3):
//   x_{k+1} = x_k + (f_k + f_{k+1}) / 2     (time in samples; f shifts a state to the block after it)
//   r_k(z_k) = 0                            the equation of motion, StageModel
// Unknowns: Layout. Equations: per knot the n of the equation of motion, then the defects to the next
// knot. Both ends are fixed by equal bounds but for qdd, which the equation of motion gives.
#pragma once

#include "exactarm/nlp/problem.hpp"
#include "exactarm/ocp/objective.hpp"
#include "exactarm/ocp/stage_model.hpp"

namespace exactarm::ocp {

class Transcription : public nlp::Problem {
 public:
  explicit Transcription(const StageModel& model);

  long variables() const override { return layout_.unknowns(); }
  long constraints() const override;
  void variable_bounds(VectorRef low, VectorRef high) const override;
  void constraint_bounds(VectorRef low, VectorRef high) const override;
  // The flat motion, or what start_at() was given.
  void start(VectorRef x) const override;
  void start_at(Vector x) { start_ = std::move(x); }
  double objective(ConstVectorRef x) override;
  void gradient(ConstVectorRef x, VectorRef gradient) override;
  void constraint(ConstVectorRef x, VectorRef c) override;
  const nlp::Sparsity& jacobian_sparsity() const override { return jacobian_sparsity_; }
  void jacobian(ConstVectorRef x, double* values) override;
  const nlp::Sparsity& hessian_sparsity() const override { return hessian_sparsity_; }
  void hessian(ConstVectorRef x, double objective_factor, ConstVectorRef lambda, double* values) override;

  long stage_row(long knot) const { return knot * (layout_.axes + layout_.states()); }
  long defect_row(long knot) const { return stage_row(knot) + layout_.axes; }

 private:
  void describe_jacobian();
  void describe_hessian();

  const StageModel& model_;
  Layout layout_;
  nlp::Sparsity jacobian_sparsity_, hessian_sparsity_;
  StageWorkspace workspace_;
  StageDerivatives derivatives_;
  Objective objective_;
  Vector lambda_, residual_, start_;
};

}  // namespace exactarm::ocp
