// Coverage-guided fuzzing (libFuzzer) of the planner: any numbers in an arm and in a planning problem.
#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/solution.hpp"
#include "numbers.hpp"

namespace exactarm::fuzz {
namespace {

void plans(Numbers& from) {
  const Robot robot(from.description());
  ocp::Problem problem = ocp::problem_of(robot);
  const long knots = from.whole(0, kMostRows);
  problem.q_desired = from.matrix(knots, from.flag() ? robot.axes() : from.whole(0, 9));
  if (from.flag()) problem.step = from.number();
  if (from.flag()) problem.weight = from.number();
  if (from.flag()) problem.input = ocp::Input::jerk;
  if (from.flag()) problem.direction = from.matrix(knots, robot.axes());
  if (from.flag()) problem.phi_shift = from.matrix(from.whole(0, kMostRows), robot.axes());
  if (from.flag()) problem.bounds.q_dot = from.vector(from.whole(0, 9));
  if (from.flag()) problem.gears.assign(static_cast<size_t>(from.whole(0, 9)), from.gear());
  ocp::SolveOptions options;
  options.iterations = from.whole(-1, 3);
  options.threads = from.whole(-1, 2);
  options.seconds = 1.0;
  ocp::solve(problem, ocp::RobotDynamics(robot), options);
}

}  // namespace
}  // namespace exactarm::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace exactarm::fuzz;
  return run(std::array<Entry, 1>{plans}, data, size);
}
