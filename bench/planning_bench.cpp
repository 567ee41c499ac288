// The stage-wise solver by parts on a motion like the thesis' line: what one iteration costs.
//   planning_bench [knots] [threads]
// Prints one JSON object; times are the least of five runs, in s.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/stagewise.hpp"
#include "planning_cases.hpp"
#include "racer.hpp"

using namespace exactarm;
using namespace exactarm::ocp;

namespace {

template <class Work>
double least_seconds(const Work& work) {
  double least = 1e9;
  for (int run = 0; run < 5; ++run) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return least;
}

}  // namespace

int main(int argc, char** argv) {
  const long knots = argc > 1 ? std::atol(argv[1]) : 2501;
  const int threads = argc > 2 ? std::atoi(argv[2]) : 2;
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  Problem problem = problem_of(robot);
  const Vector from = (Vector(6) << 0, 1.57, -0.36, 0, 1.93, 0).finished();
  const Vector to = (Vector(6) << 0.55, 1.4, -0.2, 0, 2.0, 0.5).finished();
  testing::Random random;
  problem.q_desired = testing::random_reference(random, knots, from, to, 0.0);
  const StageModel model(problem, dynamics, threads);
  const Layout layout = model.layout();

  Vector z(layout.unknowns()), diagonal = Vector::Ones(layout.unknowns());
  StageWorkspace workspace(model);
  StageDerivatives derivatives(layout);
  KktVector right(layout), solution(layout);
  right.z.setRandom();
  auto kkt = make_block_kkt(layout, threads);
  const double guess = least_seconds([&] { initial_guess(model, z.data()); });
  const double first = least_seconds([&] { model.derivatives(z.data(), nullptr, workspace, derivatives); });
  const Vector lambda = Vector::Constant(knots * 6, 1e-3);
  const double second =
      least_seconds([&] { model.derivatives(z.data(), lambda.data(), workspace, derivatives); });
  const double factorise = least_seconds([&] { kkt->factorise(derivatives, diagonal); });
  const double solve = least_seconds([&] { kkt->solve(right, solution); });
  nlp::Solution answer;
  // Processor time too, of all threads: on a busy machine the wall clock says little.
  double processor = 1e9;
  const double all = least_seconds([&] {
    const std::clock_t begin = std::clock();
    answer = solve_stagewise(model, {});
    processor = std::min(processor, double(std::clock() - begin) / CLOCKS_PER_SEC);
  });
  std::printf(
      "{\"knots\": %ld, \"threads\": %d, \"guess\": %.5f, \"first_derivatives\": %.5f, "
      "\"second_derivatives\": %.5f, \"factorise\": %.5f, \"solve\": %.5f, \"all\": %.5f, "
      "\"all_processor\": %.5f, \"iterations\": %d, \"status\": \"%s\"}\n",
      knots, threads, guess, first, second, factorise, solve, all, processor, answer.iterations,
      nlp::status_name(answer.status));
}
