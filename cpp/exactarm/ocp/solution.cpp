#include "exactarm/ocp/solution.hpp"

#include <chrono>

#include "exactarm/ocp/barrier.hpp"
#include "exactarm/ocp/objective.hpp"
#include "exactarm/ocp/transcription.hpp"

namespace exactarm::ocp {
namespace {

RowMatrix block(const Layout& layout, const Vector& z, int which, double factor) {
  RowMatrix out(layout.knots, layout.axes);
  for (long k = 0; k < layout.knots; ++k)
    out.row(k) = factor * z.segment(k * layout.width() + which * layout.axes, layout.axes).transpose();
  return out;
}

// Whether the start lies well within all bounds that leave a range: then no barrier needs to be followed down.
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

}  // namespace

Motion solve(const Problem& problem, const StageDynamics& dynamics, const SolveOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const StageModel model(problem, dynamics, options.threads);
  const Objective objective(problem);
  Motion motion;
  nlp::Solution solution;
  if (options.method == Method::stagewise) {
    StagewiseOptions own;
    own.iterations = options.iterations;
    own.seconds = options.seconds;
    solution = solve_stagewise(model, own);
    motion.objective_scale = solution.objective_scale;
  } else {
    Transcription transcription(model);
    Vector start(transcription.variables());
    transcription.start(start);
    nlp::IpoptOptions ipopt;
    ipopt.linear_solver = options.linear_solver;
    ipopt.iterations = options.iterations;
    ipopt.seconds = options.seconds;
    ipopt.print_level = options.print_level;
    ipopt.objective_scale = motion.objective_scale = objective.natural_scale(start.data());
    ipopt.tolerance = std::max(ipopt.tolerance, objective.gradient_floor(ipopt.objective_scale));
    if (lies_inside(transcription, start)) ipopt.first_barrier = 0.1 * ipopt.last_barrier;
    solution = nlp::solve_ipopt(transcription, ipopt);
  }
  motion.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
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
