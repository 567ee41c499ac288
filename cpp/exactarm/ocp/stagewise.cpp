#include "exactarm/ocp/stagewise.hpp"

#include <algorithm>
#include <chrono>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/ocp/direction.hpp"
#include "exactarm/ocp/ending.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "exactarm/ocp/line_search.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;

constexpr double kFirstBarrier = 1e3;       // where bounds become active, their multipliers are large
constexpr double kLargestCurvature = 1e-2;  // rad of new residual that a step may make
constexpr double kTinyStep = 1e-6;          // rad; damping of such a step comes from rounding
constexpr int kMostIterations = 10000;      // of which the filter keeps a point each

// The bounds of all knots, those at the ends, which are fixed, but left out.
Barrier interior_barrier(const StageModel& model) {
  const Layout& layout = model.layout();
  const int width = layout.width();
  Vector low(width), high(width);
  knot_bounds(model.problem(), low, high);
  const auto inside = [&](const Vector& bound, double none) {
    Vector all = bound.replicate(layout.knots, 1);
    all.head(width).setConstant(none);
    all.tail(width).setConstant(none);
    return all;
  };
  return Barrier(inside(low, -1e20), inside(high, 1e20));
}

// The order of Transcription: per knot the equation of motion, then the defects to the next.
// visit(first row, multipliers of the stage-wise form, their number).
template <class Point, class Visit>
void each_multiplier_block(const Layout& layout, Point& point, const Visit& visit) {
  const int n = layout.axes, s = layout.states();
  for (long k = 0; k < layout.knots; ++k) {
    visit(k * (n + s), point.stage.segment(k * n, n));
    if (k + 1 < layout.knots) visit(k * (n + s) + n, point.defect.segment(k * s, s));
  }
}

KktVector first_point(const StageModel& model, const StagewiseOptions& options) {
  KktVector point(model.layout());
  if (options.start)
    point.z = options.start->point.x;
  else
    initial_guess(model, point.z.data());
  return point;
}

class Solver {
 public:
  Solver(const StageModel& model, const StagewiseOptions& options)
      : model_(model),
        options_(options),
        iterations_(std::min(options.iterations, kMostIterations)),
        objective_(model.problem()),
        point_(first_point(model, options)),
        scale_(options.objective_scale > 0.0 ? options.objective_scale
                                             : objective_.natural_scale(point_.z.data())),
        workspace_(model),
        derivatives_(model.layout()),
        barrier_(interior_barrier(model)),
        conditions_(model, objective_, scale_),
        direction_(model, objective_, scale_, options.last_barrier),
        line_search_(model, objective_, scale_, std::max(iterations_, 0) + 1) {
    if (options.start) {
      const nlp::Solution& start = *options.start;
      const double factor = scale_ / start.objective_scale;
      each_multiplier_block(model.layout(), point_, [&](long row, auto&& multipliers) {
        multipliers = factor * start.point.lambda.segment(row, multipliers.size());
      });
    }
  }

  nlp::Solution run() {
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    nlp::Solution solution;
    solution.linear_solver = "block Riccati";
    solution.status = Status::iteration_limit;
    solution.message = "iteration limit";
    const bool inside = barrier_.start(point_.z, options_.last_barrier);
    if (!inside) barrier_.start(point_.z, kFirstBarrier);
    Ending ending(model_, options_, inside);
    for (int iteration = 0; iteration <= iterations_; ++iteration) {
      solution.iterations = iteration;
      check_interrupt();
      model_.derivatives(point_.z.data(), point_.stage.data(), workspace_, derivatives_);
      conditions_.evaluate(point_, derivatives_, barrier_);
      const double objective = scale_ * objective_.value(point_.z.data());
      if (ending.reached(point_, conditions_, barrier_, objective, solution) || iteration == iterations_)
        break;
      if (elapsed() > options_.seconds) {
        solution.status = Status::time_limit;
        solution.message = "time limit";
        break;
      }
      const char* const failure = direction_.find(point_, derivatives_, conditions_, barrier_);
      if (*failure) {
        solution.status = Status::numerical_failure;
        solution.message = failure;
        break;
      }
      advance(ending);
    }
    report(solution);
    solution.seconds = elapsed();
    return solution;
  }

 private:
  void advance(Ending& ending) {
    const KktVector& step = direction_.step();
    const double largest = step.z.cwiseAbs().maxCoeff();
    double length = direction_.primal();
    // Longer than this the equation of motion is not near its linearisation: ask it.
    if (direction_.indefinite() || largest > kLargestCurvature)
      length = line_search_.accepted_length(point_, conditions_.residual(), step, length, workspace_);
    point_.z += length * step.z;
    point_.stage += length * step.stage;
    point_.defect += length * step.defect;
    barrier_.move(length, direction_.dual());
    const bool hard = direction_.damped() || length < direction_.primal();
    ending.count_step(length, hard && largest > kTinyStep);
  }

  void report(nlp::Solution& solution) const {
    const Layout& layout = model_.layout();
    solution.objective = objective_.value(point_.z.data());
    solution.objective_scale = scale_;
    solution.point.x = point_.z;
    solution.point.lambda.resize(layout.knots * (layout.axes + layout.states()) - layout.states());
    each_multiplier_block(layout, point_, [&](long row, const auto& multipliers) {
      solution.point.lambda.segment(row, multipliers.size()) = multipliers;
    });
    solution.point.z_low = barrier_.low_multipliers();
    solution.point.z_high = barrier_.high_multipliers();
  }

  const StageModel& model_;
  const StagewiseOptions& options_;
  const int iterations_;
  const Objective objective_;
  KktVector point_;
  const double scale_;
  StageWorkspace workspace_;
  StageDerivatives derivatives_;
  Barrier barrier_;
  FirstOrder conditions_;
  Direction direction_;
  LineSearch line_search_;
};

}  // namespace

nlp::Solution solve_stagewise(const StageModel& model, const StagewiseOptions& options) {
  return Solver(model, options).run();
}

}  // namespace exactarm::ocp
