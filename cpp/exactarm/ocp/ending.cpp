#include "exactarm/ocp/ending.hpp"

#include "exactarm/ocp/reach.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;

constexpr double kStalledLength = 1e-3;  // share of the Newton step
constexpr int kStalledSteps = 8;         // of that length or less, one after the other
constexpr double kRunaway = 1e10;        // of the objective's gradient: a multiplier that grows without limit
constexpr double kAcceptableObjective = 1e-6, kAcceptableFactor = 10.0;
constexpr int kRoundedSteps = 6;  // that good without getting better: rounding is reached
const char* const kBlockNames[] = {"q", "q_dot", "q_ddot", "theta", "theta_dot", "theta_ddot", "jerk"};

bool end(nlp::Solution& solution, Status status, std::string message) {
  solution.status = status;
  solution.message = std::move(message);
  return true;
}

}  // namespace

Ending::Ending(const StageModel& model, const StagewiseOptions& options, bool inside)
    : model_(model), options_(options), inside_(inside) {}

void Ending::count_step(double length, bool hard) {
  stalled_ = length < kStalledLength ? stalled_ + 1 : 0;
  hard_steps_ += hard;
}

bool Ending::reached(const KktVector& point, const FirstOrder& conditions, const Barrier& barrier,
                     double objective, nlp::Solution& solution) {
  const double dual = conditions.stationarity(), equations = conditions.largest_equation();
  if (!std::isfinite(dual) || !std::isfinite(equations))
    return end(solution, Status::numerical_failure, "a value is not finite");
  long index;
  bool at_low;
  const double violation = barrier.violation(point.z, index, at_low);
  // Sums of large terms round off more than the tolerance asks.
  const double tolerance = std::max(options_.tolerance, conditions.rounding());
  const double owed = conditions.owed(point);
  const bool kept = equations <= options_.feasibility && violation <= options_.feasibility &&
                    barrier.largest_product() <= 2.0 * options_.last_barrier;
  if (kept && dual <= tolerance && owed <= options_.objective * objective + 1e-12)
    return end(solution, Status::solved, "solved");
  rounded_ += kept && dual <= kAcceptableFactor * tolerance && owed <= kAcceptableObjective * objective;
  if (rounded_ >= kRoundedSteps)
    return end(solution, Status::acceptable, "solved as far as the rounding of large multipliers allows");
  const bool stalled = stalled_ >= kStalledSteps;
  const bool runaway = barrier.largest_multiplier() > kRunaway * (1.0 + conditions.largest_gradient());
  if (violation > options_.feasibility && (runaway || stalled)) {
    const std::string reach = out_of_reach(model_, point.z.data());
    if (!reach.empty()) return end(solution, Status::infeasible, "no motion within the bounds: " + reach);
    return end(solution, Status::numerical_failure,
               "no motion within the bounds was found: " + describe(index, at_low, violation));
  }
  if (stalled || (inside_ && hard_steps_ > options_.hard_steps))
    return end(solution, Status::numerical_failure, "steps became too short");
  return false;
}

std::string Ending::describe(long index, bool at_low, double violation) const {
  const Layout& layout = model_.layout();
  const int within = static_cast<int>(index % layout.width());
  char text[160];
  std::snprintf(text, sizeof text, "%s of joint %d at knot %ld is %.3g %s its limit (units of one sample)",
                kBlockNames[within / layout.axes], within % layout.axes + 1, index / layout.width(),
                violation, at_low ? "below" : "above");
  return text;
}

}  // namespace exactarm::ocp
