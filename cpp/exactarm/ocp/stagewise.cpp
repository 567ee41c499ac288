#include "exactarm/ocp/stagewise.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/ocp/barrier.hpp"
#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "exactarm/ocp/objective.hpp"
#include "exactarm/ocp/reach.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;

constexpr double kKeptShare = 0.005;        // of a slack after a step
constexpr double kFirstBarrier = 1e3;       // where bounds become active, their multipliers are large
constexpr double kDampedBarrier = 0.1;
constexpr double kLargestCurvature = 1e-2;  // rad of new residual that a step may make
constexpr int kStalledSteps = 8;
constexpr double kRoundings = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double kLeastDamping = 1e-4, kMostDamping = 1e20;  // of the reduced Hessian
constexpr double kFilterMargin = 1e-5;
constexpr int kMostHalvings = 12;
constexpr int kMostIterations = 10000;     // of which the filter keeps an entry each
constexpr double kTinyStep = 1e-6;          // rad; damping of such a step comes from rounding
constexpr double kAcceptableObjective = 1e-6, kAcceptableFactor = 10.0;
constexpr int kRoundedSteps = 6;            // that good without getting better: rounding is reached
const char* const kBlockNames[] = {"q", "q_dot", "q_ddot", "theta", "theta_dot", "theta_ddot", "jerk"};

class Solver {
 public:
  Solver(const StageModel& model, const StagewiseOptions& options)
      : model_(model),
        layout_(model.layout()),
        options_(options),
        objective_(model.problem()),
        workspace_(model),
        derivatives_(layout_),
        kkt_(make_block_kkt(layout_, model.threads())),
        barrier_(interior_bound(-1), interior_bound(1)),
        right_(layout_),
        step_(layout_),
        current_(layout_),
        diagonal_(layout_.unknowns()),
        base_diagonal_(Vector::Zero(layout_.unknowns())),
        gradient_(layout_.unknowns()),
        stationarity_(layout_.unknowns()),
        lagrangian_(layout_.unknowns()),
        trial_(layout_.unknowns()),
        trial_residual_(layout_.knots * layout_.axes) {
    filter_.reserve(static_cast<std::size_t>(std::clamp(options.iterations, 0, kMostIterations)) + 1);
  }

  nlp::Solution run() {
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    nlp::Solution solution;
    solution.linear_solver = "block Riccati";
    if (options_.start)
      current_.z = options_.start->point.x;
    else
      initial_guess(model_, current_.z.data());
    scale_ = options_.objective_scale > 0.0 ? options_.objective_scale
                                            : objective_.natural_scale(current_.z.data());
    if (options_.start) take_multipliers(*options_.start);
    objective_diagonal();
    inside_ = barrier_.start(current_.z, options_.last_barrier);
    if (!inside_) barrier_.start(current_.z, kFirstBarrier);
    solution.status = Status::iteration_limit;
    solution.message = "iteration limit";
    for (int iteration = 0; iteration <= std::min(options_.iterations, kMostIterations); ++iteration) {
      solution.iterations = iteration;
      check_interrupt();
      model_.derivatives(current_.z.data(), current_.stage.data(), workspace_, derivatives_);
      residuals();
      if (finished(solution) || iteration == options_.iterations) break;
      if (elapsed() > options_.seconds) {
        solution.status = Status::time_limit;
        solution.message = "time limit";
        break;
      }
      if (!advance(solution)) break;
    }
    report(solution);
    solution.seconds = elapsed();
    return solution;
  }

 private:
  // The ends are fixed and have no bounds here.
  Vector interior_bound(int side) const {
    const int width = layout_.width();
    Vector low(width), high(width);
    knot_bounds(model_.problem(), low, high);
    Vector bound = (side < 0 ? low : high).replicate(layout_.knots, 1);
    bound.head(width).setConstant(side * 1e20);
    bound.tail(width).setConstant(side * 1e20);
    return bound;
  }

  // The order of Transcription, as in report().
  void take_multipliers(const nlp::Solution& start) {
    const int n = layout_.axes, s = layout_.states();
    const double factor = scale_ / start.objective_scale;
    for (long k = 0; k < layout_.knots; ++k) {
      current_.stage.segment(k * n, n) = factor * start.point.lambda.segment(k * (n + s), n);
      if (k + 1 < layout_.knots)
        current_.defect.segment(k * s, s) = factor * start.point.lambda.segment(k * (n + s) + n, s);
    }
  }

  void objective_diagonal() {
    const int n = layout_.axes, width = layout_.width();
    const Vector& weights = objective_.input_weights();
    for (long k = 0; k < layout_.knots; ++k) {
      base_diagonal_.segment(k * width + kQ * n, n).setConstant(2.0 * scale_);
      base_diagonal_.segment(k * width + layout_.input() * n, n) = 2.0 * scale_ * weights;
    }
  }

  void residuals() {
    const int n = layout_.axes, width = layout_.width(), s = layout_.states(), n2 = n * n;
    right_.stage = derivatives_.residual;
    objective_.gradient(current_.z.data(), gradient_.data());
    gradient_ *= scale_;
    lagrangian_ = gradient_;
    largest_term_ = current_.defect.cwiseAbs().maxCoeff();
    const Vector& z = current_.z;
    for (long k = 0; k < layout_.knots; ++k) {
      const Eigen::Map<const Matrix> by_q(&derivatives_.by_q[k * n2], n, n), by_rate(&derivatives_.by_q_dot[k * n2], n, n),
          by_qdd(&derivatives_.by_q_ddot[k * n2], n, n);
      const double* lambda = &current_.stage[k * n];
      const double entries =
          std::max({by_q.cwiseAbs().maxCoeff(), by_rate.cwiseAbs().maxCoeff(), by_qdd.cwiseAbs().maxCoeff()});
      largest_term_ = std::max(largest_term_, entries * current_.stage.segment(k * n, n).cwiseAbs().maxCoeff());
      double* out = &lagrangian_[k * width];
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
          out[j] += by_q(i, j) * lambda[i];
          out[n + j] += by_rate(i, j) * lambda[i];
          out[2 * n + j] += by_qdd(i, j) * lambda[i];
        }
        out[kTheta * n + j] += derivatives_.by_theta[k * n + j] * lambda[j];
      }
      if (k + 1 == layout_.knots) break;
      for (int b = 0; b < layout_.state_blocks(); ++b)
        for (int i = 0; i < n; ++i) {
          const long here = k * width + Layout::state_block(b) * n + i, there = here + width;
          right_.defect[k * s + b * n + i] = z[there] - z[here] - 0.5 * (z[here + n] + z[there + n]);
          const double pi = current_.defect[k * s + b * n + i];
          lagrangian_[there] += pi;
          lagrangian_[here] -= pi;
          lagrangian_[here + n] -= 0.5 * pi;
          lagrangian_[there + n] -= 0.5 * pi;
        }
    }
    stationarity_ = lagrangian_;
    barrier_.add_multipliers(stationarity_);
    for (long k : {0L, layout_.knots - 1})
      for (int i = 0; i < width; ++i)
        if (i / n != kQDdot) stationarity_[k * width + i] = 0.0;
  }

  bool finished(nlp::Solution& solution) {
    const double dual = stationarity_.cwiseAbs().maxCoeff();
    const double equations = std::max(right_.stage.cwiseAbs().maxCoeff(), right_.defect.cwiseAbs().maxCoeff());
    if (!std::isfinite(dual) || !std::isfinite(equations)) {
      solution.status = Status::numerical_failure;
      solution.message = "a value is not finite";
      return true;
    }
    long index;
    bool at_low;
    const double violation = barrier_.violation(current_.z, index, at_low);
    // Sums of terms this large round off more than the tolerance asks.
    const double tolerance =
        std::max({options_.tolerance, objective_.gradient_floor(scale_), kRoundings * largest_term_});
    const double owed = std::abs(right_.stage.dot(current_.stage) + right_.defect.dot(current_.defect));
    const double objective = scale_ * objective_.value(current_.z.data());
    const bool kept = equations <= options_.feasibility && violation <= options_.feasibility &&
                      barrier_.largest_product() <= 2.0 * options_.last_barrier;
    if (kept && dual <= tolerance && owed <= options_.objective * objective + 1e-12) {
      solution.status = Status::solved;
      solution.message = "solved";
      return true;
    }
    rounded_ += kept && dual <= kAcceptableFactor * tolerance && owed <= kAcceptableObjective * objective;
    if (rounded_ >= kRoundedSteps) {
      solution.status = Status::acceptable;
      solution.message = "solved as far as the rounding of large multipliers allows";
      return true;
    }
    const double largest_gradient = gradient_.cwiseAbs().maxCoeff();
    const bool runaway = barrier_.largest_multiplier() > 1e10 * (1.0 + largest_gradient);
    if (violation > options_.feasibility && (runaway || stalled_ >= kStalledSteps)) {
      const std::string reach = out_of_reach(model_, current_.z.data());
      solution.status = reach.empty() ? Status::numerical_failure : Status::infeasible;
      solution.message = "no motion within the bounds: " + reach;
      if (reach.empty()) solution.message = "no motion within the bounds was found: " + describe(index, at_low, violation);
      return true;
    }
    if (stalled_ >= kStalledSteps || (inside_ && hard_steps_ > options_.hard_steps)) {
      solution.status = Status::numerical_failure;
      solution.message = "steps became too short";
      return true;
    }
    return false;
  }

  std::string describe(long index, bool at_low, double violation) const {
    const int within = static_cast<int>(index % layout_.width());
    char text[160];
    std::snprintf(text, sizeof text, "%s of joint %d at knot %ld is %.3g %s its limit (units of one sample)",
                  kBlockNames[within / layout_.axes], within % layout_.axes + 1, index / layout_.width(), violation,
                  at_low ? "below" : "above");
    return text;
  }

  // Steps of the multipliers, not the multipliers themselves: large ones would cost the digits of a small step.
  bool solve(double tau, bool corrected) {
    right_.z = lagrangian_;
    barrier_.add_gradient(current_.z, tau, corrected, right_.z);
    return kkt_->solve(right_, step_);
  }

  // Adds the least damping (a power of a few) that makes the whole reduced Hessian positive definite.
  bool factorise() {
    const double last = damping_;
    diagonal_ = base_diagonal_;
    barrier_.add_diagonal(diagonal_);
    damping_ = 0.0;
    if (kkt_->factorise(derivatives_, diagonal_)) return true;
    if (!damped_before_) {
      // Far from the start's basin: a small barrier would pin the motion to the first bounds that it meets.
      barrier_.start(current_.z, kDampedBarrier);
      damped_before_ = true;
    }
    for (damping_ = std::max(last / 3.0, kLeastDamping); damping_ < kMostDamping; damping_ *= last > 0.0 ? 3.0 : 10.0) {
      diagonal_ = base_diagonal_.array() + damping_;
      barrier_.add_diagonal(diagonal_);
      if (kkt_->factorise(derivatives_, diagonal_)) return true;
    }
    return false;
  }

  bool advance(nlp::Solution& solution) {
    if (!factorise()) {
      solution.status = Status::numerical_failure;
      solution.message = "the Newton system is singular";
      return false;
    }
    const double average = barrier_.average();
    double primal = 1.0, dual = 1.0, tau = options_.last_barrier;
    bool solved = true, corrected = false;
    if (average > 10.0 * options_.last_barrier) {
      solved = solve(0.0, false);
      barrier_.set_step(current_.z, step_.z, 0.0, false);
      barrier_.longest_steps(0.0, primal, dual);
      const double after = barrier_.average_after(primal, dual);
      tau = std::max(std::pow(after / average, 3) * average, options_.last_barrier);
      barrier_.keep_products();
      corrected = true;
    }
    solved = solved && solve(tau, corrected);
    if (!solved) {
      solution.status = Status::numerical_failure;
      solution.message = "the Newton step is not finite";
      return false;
    }
    barrier_.set_step(current_.z, step_.z, tau, corrected);
    barrier_.longest_steps(kKeptShare, primal, dual);
    // Longer than this the equation of motion is not near its linearisation: ask it.
    const double longest = primal;
    const bool curved = damping_ > 0.0 || kkt_->negative_pivots() > 0;
    if (curved || step_.z.cwiseAbs().maxCoeff() > kLargestCurvature) primal = accepted_step(primal);
    current_.z += primal * step_.z;
    current_.stage += primal * step_.stage;
    current_.defect += primal * step_.defect;
    barrier_.move(primal, dual);
    stalled_ = primal < 1e-3 ? stalled_ + 1 : 0;
    if ((damping_ > 0.0 || primal < longest) && step_.z.cwiseAbs().maxCoeff() > kTinyStep) ++hard_steps_;
    return true;
  }

  // Halves the step until no earlier point was better in both, the equations and the objective (a filter, Fletcher
  // and Leyffer 2002). The shortest step is taken in any case.
  double accepted_step(double primal) {
    const double gaps = right_.defect.lpNorm<1>();
    filter_.push_back({scale_ * objective_.value(current_.z.data()), right_.stage.lpNorm<1>() + gaps});
    for (int halving = 0; halving < kMostHalvings; ++halving, primal *= 0.5) {
      trial_ = current_.z + primal * step_.z;
      model_.residual(trial_.data(), workspace_, trial_residual_.data());
      const Merit merit{scale_ * objective_.value(trial_.data()), trial_residual_.lpNorm<1>() + (1.0 - primal) * gaps};
      const bool better = std::all_of(filter_.begin(), filter_.end(), [&](const Merit& m) {
        return merit.violation <= (1.0 - kFilterMargin) * m.violation ||
               merit.objective <= m.objective - kFilterMargin * m.violation;
      });
      if (better) break;
    }
    return primal;
  }

  void report(nlp::Solution& solution) {
    const int n = layout_.axes, s = layout_.states();
    solution.objective = objective_.value(current_.z.data());
    solution.objective_scale = scale_;
    solution.point.x = current_.z;
    // The order of Transcription: per knot the equation of motion, then the defects to the next.
    solution.point.lambda.resize(layout_.knots * (n + s) - s);
    for (long k = 0; k < layout_.knots; ++k) {
      solution.point.lambda.segment(k * (n + s), n) = current_.stage.segment(k * n, n);
      if (k + 1 < layout_.knots)
        solution.point.lambda.segment(k * (n + s) + n, s) = current_.defect.segment(k * s, s);
    }
    solution.point.z_low = barrier_.low_multipliers();
    solution.point.z_high = barrier_.high_multipliers();
  }

  const StageModel& model_;
  Layout layout_;
  StagewiseOptions options_;
  Objective objective_;
  StageWorkspace workspace_;
  StageDerivatives derivatives_;
  std::unique_ptr<BlockKkt> kkt_;
  Barrier barrier_;
  KktVector right_, step_, current_;
  Vector diagonal_, base_diagonal_, gradient_, stationarity_, lagrangian_, trial_, trial_residual_;
  double scale_ = 1.0, damping_ = 0.0, largest_term_ = 0.0;
  bool damped_before_ = false;
  struct Merit {
    double objective, violation;
  };
  std::vector<Merit> filter_;  // one entry an iteration at most
  int stalled_ = 0, hard_steps_ = 0, rounded_ = 0;
  bool inside_ = false;
};

}  // namespace

nlp::Solution solve_stagewise(const StageModel& model, const StagewiseOptions& options) {
  return Solver(model, options).run();
}

}  // namespace exactarm::ocp
