// The first-order conditions of the transcription at a point: what Newton's method has to bring to zero.
//   grad (scale f) + J' lambda + defects' pi + y_high - y_low = 0,   r(z) = 0,   defects(z) = 0
// lambda of the equation of motion (stage), pi of the defects, y of the bounds (barrier.hpp). rad.
#pragma once

#include "exactarm/ocp/barrier.hpp"
#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/objective.hpp"

namespace exactarm::ocp {

class FirstOrder {
 public:
  // `scale` of the objective.
  FirstOrder(const StageModel& model, const Objective& objective, double scale);

  // `derivatives` of the equation of motion at the point.
  void evaluate(const KktVector& point, const StageDerivatives& derivatives, const Barrier& barrier);

  // z: gradient of the Lagrangian without the bounds; stage, defect: what the equations leave.
  const KktVector& residual() const { return residual_; }
  // Largest entry of the gradient of the whole Lagrangian, where z is free; and of what the equations leave.
  // Not finite where an entry is not.
  double stationarity() const;
  double largest_equation() const;
  double largest_gradient() const { return gradient_.cwiseAbs().maxCoeff(); }  // of the objective
  // Below this the sums cannot be told from zero.
  double rounding() const;
  // What the multipliers say the equations' residual does to the objective.
  double owed(const KktVector& point) const;

 private:
  void add_equation_of_motion(const KktVector& point, const StageDerivatives& derivatives, long k);
  void add_defects(const KktVector& point, long k);

  const Objective& objective_;
  Layout layout_;
  double scale_, largest_term_ = 0.0;
  KktVector residual_;
  Vector gradient_, stationarity_;
};

}  // namespace exactarm::ocp
