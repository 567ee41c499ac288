// The Newton step of the barrier problem and how far the bounds allow it (Mehrotra 1992: a predictor chooses
// the barrier, a corrector makes up for its products).
// If the reduced Hessian of a knot is indefinite, the least multiple of the identity that makes it definite
// is added to it (Levenberg).
#pragma once

#include "exactarm/ocp/barrier.hpp"
#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/first_order.hpp"

namespace exactarm::ocp {

class Direction {
 public:
  // `scale` of the objective; the barrier never falls below `last_barrier`.
  Direction(const StageModel& model, const Objective& objective, double scale, double last_barrier);

  // The step from `point`, whose slacks and multipliers the barrier holds; sets its step, too. Empty, or why
  // there is none.
  const char* find(const KktVector& point, const StageDerivatives& derivatives, const FirstOrder& conditions,
                   Barrier& barrier);

  const KktVector& step() const { return step_; }
  // Largest shares of the step that keep every slack and every multiplier above zero.
  double primal() const { return primal_; }
  double dual() const { return dual_; }
  bool damped() const { return damping_ > 0.0; }
  // Whether the reduced Hessian was indefinite somewhere, in the whole or in a half.
  bool indefinite() const { return damped() || kkt_->negative_pivots() > 0; }

 private:
  bool factorise(const KktVector& point, const StageDerivatives& derivatives, Barrier& barrier);
  bool factorise_with(double damping, const StageDerivatives& derivatives, const Barrier& barrier);
  bool solve(const KktVector& point, const FirstOrder& conditions, const Barrier& barrier, double tau,
             bool corrected);

  std::unique_ptr<BlockKkt> kkt_;
  double last_barrier_;
  Vector of_objective_, diagonal_;  // of the Hessian
  KktVector right_, step_;
  double damping_ = 0.0, primal_ = 1.0, dual_ = 1.0;
  bool damped_before_ = false;
};

}  // namespace exactarm::ocp
