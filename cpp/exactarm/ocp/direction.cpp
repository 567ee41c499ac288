#include "exactarm/ocp/direction.hpp"

namespace exactarm::ocp {
namespace {

constexpr double kKeptShare = 0.005;  // of a slack after a step
constexpr double kLeastDamping = 1e-4, kMostDamping = 1e20;  // of the reduced Hessian
// Far from the start's basin: a small barrier would pin the motion to the first bounds that it meets.
constexpr double kDampedBarrier = 0.1;

}  // namespace

Direction::Direction(const StageModel& model, const Objective& objective, double scale, double last_barrier)
    : kkt_(make_block_kkt(model.layout(), model.threads())),
      last_barrier_(last_barrier),
      of_objective_(objective.hessian_diagonal(scale)),
      diagonal_(model.layout().unknowns()),
      right_(model.layout()),
      step_(model.layout()) {}

const char* Direction::find(const KktVector& point, const StageDerivatives& derivatives,
                            const FirstOrder& conditions, Barrier& barrier) {
  if (!factorise(point, derivatives, barrier)) return "the Newton system is singular";
  right_.stage = conditions.residual().stage;
  right_.defect = conditions.residual().defect;
  const double average = barrier.average();
  double tau = last_barrier_;
  bool solved = true, corrected = false;
  if (average > 10.0 * last_barrier_) {
    solved = solve(point, conditions, barrier, 0.0, false);
    barrier.set_step(point.z, step_.z, 0.0, false);
    barrier.longest_steps(0.0, primal_, dual_);
    const double after = barrier.average_after(primal_, dual_);
    tau = std::max(std::pow(after / average, 3) * average, last_barrier_);
    barrier.keep_products();
    corrected = true;
  }
  if (!solved || !solve(point, conditions, barrier, tau, corrected)) return "the Newton step is not finite";
  barrier.set_step(point.z, step_.z, tau, corrected);
  barrier.longest_steps(kKeptShare, primal_, dual_);
  return "";
}

// A power of a few is fine enough for the damping; the next one is looked for below the last.
bool Direction::factorise(const KktVector& point, const StageDerivatives& derivatives, Barrier& barrier) {
  const double last = damping_;
  if (factorise_with(0.0, derivatives, barrier)) return true;
  if (!damped_before_) {
    barrier.start(point.z, kDampedBarrier);
    damped_before_ = true;
  }
  const double growth = last > 0.0 ? 3.0 : 10.0;
  for (double damping = std::max(last / 3.0, kLeastDamping); damping < kMostDamping; damping *= growth)
    if (factorise_with(damping, derivatives, barrier)) return true;
  return false;
}

bool Direction::factorise_with(double damping, const StageDerivatives& derivatives, const Barrier& barrier) {
  damping_ = damping;
  diagonal_ = of_objective_.array() + damping;
  barrier.add_diagonal(diagonal_);
  return kkt_->factorise(derivatives, diagonal_);
}

// Steps of the multipliers, not the multipliers themselves: large ones would cost the digits of a small step.
bool Direction::solve(const KktVector& point, const FirstOrder& conditions, const Barrier& barrier,
                      double tau, bool corrected) {
  right_.z = conditions.residual().z;
  barrier.add_gradient(point.z, tau, corrected, right_.z);
  return kkt_->solve(right_, step_);
}

}  // namespace exactarm::ocp
