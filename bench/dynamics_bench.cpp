// Kinematics and dynamics of one 6-axis robot, a call each; rows "knot_*" are per knot of a batch of 512.
// Rows of the same name with "pinocchio/" are the same quantity by that library in the same run.
#include <benchmark/benchmark.h>

#include <cstdio>

#include "exactarm/robot/dynamics.hpp"
#include "exactarm/robot/dynamics_derivatives.hpp"
#include "exactarm/robot/kinematics.hpp"
#include "exactarm/robot/regressor.hpp"
#include "sample_states.hpp"

#ifdef EXACTARM_BENCH_PINOCCHIO
void register_pinocchio(const exactarm::Robot& robot, const exactarm::bench::States& states);
double largest_difference(const exactarm::Robot& robot, const exactarm::bench::States& states);
#endif

namespace {

using namespace exactarm;

template <class Call>
void row(const char* name, const Call& call) {
  benchmark::RegisterBenchmark(name, [call](benchmark::State& state) {
    long k = 0;
    for (auto _ : state) {
      call(k);
      benchmark::ClobberMemory();
      k = (k + 1) % bench::kStates;
    }
  });
}

template <class Call>
void batch_row(const char* name, const Call& call) {
  benchmark::RegisterBenchmark(name, [call](benchmark::State& state) {
    for (auto _ : state) {
      call();
      benchmark::ClobberMemory();
    }
    state.counters["rows"] = bench::kStates;  // the ratio script divides by it
  });
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  const Robot robot = bench::racer();
  const long n = robot.axes();
  const bench::States s(n);
  const DynamicsModel model(robot);
  DynamicsWorkspace workspace(model);
  DerivativesWorkspace derivatives(model);
  KnotWorkspace knots(model);
  DynamicsDerivatives out(n);
  Vector tau(n);
  Matrix D(n, n);

  row("forward_kinematics", [&](long k) { benchmark::DoNotOptimize(forward_kinematics(robot, s.q.col(k))); });
  row("inverse_dynamics",
      [&](long k) { inverse_dynamics(model, workspace, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k), tau); });
  row("gravity_torque", [&](long k) { gravity_torque(model, workspace, s.q.col(k), tau); });
  row("mass_matrix", [&](long k) { mass_matrix(model, workspace, s.q.col(k), D); });
  row("first_derivatives", [&](long k) {
    inverse_dynamics_derivatives(model, derivatives, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k), out);
  });
  row("first_and_second_derivatives", [&](long k) {
    inverse_dynamics_second_derivatives(model, derivatives, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k),
                                        s.lambda.col(k), out);
  });

  const RowMatrix q = s.q.transpose(), q_dot = s.q_dot.transpose(), q_ddot = s.q_ddot.transpose();
  std::vector<double> rows(bench::kStates * 10 * n * n);
  Matrix batch_tau(n, bench::kStates);
  std::vector<Matrix> blocks(7, Matrix(n * n, bench::kStates));
  KnotBatch batch{bench::kStates,   s.q.data(),       s.q_dot.data(),   s.q_ddot.data(),
                  s.lambda.data(),  batch_tau.data(), blocks[0].data(), blocks[1].data(),
                  blocks[2].data(), blocks[3].data(), blocks[4].data(), blocks[5].data(),
                  blocks[6].data()};
  KnotBatch first = batch;
  first.lambda = nullptr;
  batch_row("knot_inverse_dynamics",
            [&] { inverse_dynamics_batch(model, q, q_dot, q_ddot, rows.data(), 1); });
  batch_row("knot_mass_matrix", [&] { mass_matrix_batch(model, q, rows.data(), 1); });
  batch_row("knot_first_derivatives",
            [&] { inverse_dynamics_knots(model, knots, first, 0, bench::kStates); });
  batch_row("knot_first_and_second_derivatives",
            [&] { inverse_dynamics_knots(model, knots, batch, 0, bench::kStates); });
  batch_row("knot_regressor", [&] { dynamics_regressor_batch(robot, q, q_dot, q_ddot, rows.data(), 1); });

#ifdef EXACTARM_BENCH_PINOCCHIO
  const double difference = largest_difference(robot, s);
  std::fprintf(stderr, "largest relative difference from Pinocchio: %.1e\n", difference);
  if (!(difference < 1e-10)) return 1;
  register_pinocchio(robot, s);
#endif
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
