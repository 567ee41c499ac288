#include "exactarm/ocp/solution.hpp"

#include <chrono>

#include "exactarm/ocp/barrier.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "exactarm/ocp/objective.hpp"
#include "exactarm/ocp/reach.hpp"
#include "exactarm/ocp/transcription.hpp"
#include "exactarm/ocp/weight_continuation.hpp"

namespace exactarm::ocp {
namespace {

RowMatrix block(const Layout& layout, const Vector& z, int which, double factor) {
  RowMatrix out(layout.knots, layout.axes);
  for (long k = 0; k < layout.knots; ++k)
    out.row(k) = factor * z.segment(k * layout.width() + which * layout.axes, layout.axes).transpose();
  return out;
}

// Whether the start lies well within all bounds that leave a range:
// then no barrier needs to be followed down.
bool lies_inside(const Transcription& transcription, const Vector& start) {
  Vector low(start.size()), high(start.size());
  transcription.variable_bounds(low, high);
  for (long i = 0; i < start.size(); ++i)
    if (low[i] == high[i]) {
      low[i] = -1e20;
      high[i] = 1e20;
    }
  return Barrier(low, high).start(start, 1.0);
}

bool flat_motion_fits(const StageModel& model) {
  Vector flat(model.layout().unknowns());
  initial_guess(model, flat.data());
  return lies_inside(Transcription(model), flat);
}

// On the way to the weight that is asked for only the neighbourhood of a solution is wanted.
constexpr double kNear = 1e-3, kNearObjective = 1e-4, kNearEquations = 1e-8;
constexpr int kHardSteps = 10;
constexpr int kNearIterations = 30;
constexpr int kInsideIterations = 50;  // of Ipopt, from well within all bounds: more do not help

nlp::Solution by_stages(const StageModel& model, const SolveOptions& options, double seconds,
                        const nlp::Solution* start, bool last) {
  StagewiseOptions own;
  own.iterations = last ? options.iterations : std::min(options.iterations, kNearIterations);
  own.seconds = seconds;
  own.start = start;
  own.hard_steps = kHardSteps;
  if (!last) {
    own.tolerance = kNear;
    own.objective = kNearObjective;
    own.feasibility = kNearEquations;
  }
  return solve_stagewise(model, own);
}

nlp::Solution by_ipopt(const StageModel& model, const SolveOptions& options, double seconds,
                       const nlp::Solution* start, bool last) {
  Transcription transcription(model);
  if (start) transcription.start_at(start->point.x);
  Vector first(transcription.variables());
  transcription.start(first);
  nlp::IpoptOptions ipopt;
  ipopt.linear_solver = options.linear_solver;
  const bool inside = lies_inside(transcription, first);
  const int most = !last ? kNearIterations : inside ? kInsideIterations : options.iterations;
  ipopt.iterations = std::min(options.iterations, most);
  ipopt.seconds = seconds;
  ipopt.print_level = options.print_level;
  ipopt.objective_scale = Objective(model.problem()).natural_scale(first.data());
  ipopt.permute = model.problem().input == Input::jerk;  // a weight of 1e-10 is 5e10 on the input at 100 Hz
  if (!last) ipopt.tolerance = kNear;
  ipopt.tolerance =
      std::max(ipopt.tolerance, Objective(model.problem()).gradient_floor(ipopt.objective_scale));
  if (inside) ipopt.first_barrier = 0.1 * ipopt.last_barrier;
  return nlp::solve_ipopt(transcription, ipopt);
}

}  // namespace

Motion solve(const Problem& problem, const StageDynamics& dynamics, const SolveOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  Motion motion;
  const auto left = [&] {
    return options.seconds - std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const auto attempt = [&](const Problem& weighed, const nlp::Solution* start, bool last) {
    const StageModel model(weighed, dynamics, options.threads);
    return options.method == Method::stagewise ? by_stages(model, options, left(), start, last)
                                               : by_ipopt(model, options, left(), start, last);
  };
  nlp::Solution solution = attempt(problem, nullptr, true);
  const bool ended = solution.status == nlp::Status::solved || solution.status == nlp::Status::acceptable ||
                     solution.status == nlp::Status::time_limit || solution.status == nlp::Status::stopped;
  const StageModel model(problem, dynamics, options.threads);
  const std::string reach = ended ? "" : out_of_reach(model, solution.point.x.data());
  if (!reach.empty()) {
    solution.status = nlp::Status::infeasible;
    solution.message = "no motion within the bounds: " + reach;
  } else if (!ended && solution.iterations < options.iterations && flat_motion_fits(model)) {
    // The flat motion solves all equations but for its differences:
    // with it within the bounds there is a solution.
    if (solution.status == nlp::Status::infeasible) solution.status = nlp::Status::numerical_failure;
    solution = continue_weight(problem, solution, attempt);
  }
  motion.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  motion.objective_scale = solution.objective_scale;
  motion.status = solution.status;
  motion.message = solution.message;
  motion.linear_solver = solution.linear_solver;
  motion.iterations = solution.iterations;
  motion.objective = solution.objective;
  Transcription transcription(model);
  motion.kkt = nlp::kkt_error(transcription, solution.point, motion.objective_scale);

  const Layout layout = problem.layout();
  const Vector& z = solution.point.x;
  const double rate = 1.0 / problem.step;
  Vector ratio(layout.axes);
  for (int i = 0; i < layout.axes; ++i) ratio[i] = problem.gears[i].ratio;
  motion.q = block(layout, z, kQ, 1.0);
  motion.q_dot = block(layout, z, kQDot, rate);
  motion.q_ddot = block(layout, z, kQDdot, rate * rate);
  motion.theta = block(layout, z, kTheta, 1.0) * ratio.asDiagonal();
  motion.theta_dot = block(layout, z, kThetaDot, rate) * ratio.asDiagonal();
  motion.theta_ddot = block(layout, z, kThetaDdot, rate * rate) * ratio.asDiagonal();
  if (problem.input == Input::jerk)
    motion.theta_dddot = block(layout, z, layout.input(), rate * rate * rate) * ratio.asDiagonal();
  motion.stage_multipliers.resize(layout.knots, layout.axes);
  for (long k = 0; k < layout.knots; ++k)
    motion.stage_multipliers.row(k) =
        solution.point.lambda.segment(transcription.stage_row(k), layout.axes).transpose();
  return motion;
}

}  // namespace exactarm::ocp
