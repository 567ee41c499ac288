#include "exactarm/ocp/weight_continuation.hpp"

#include <gtest/gtest.h>

#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/solution.hpp"
#include "planning_cases.hpp"
#include "racer.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;
using testing::Random;

bool good(Status status) { return status == Status::solved || status == Status::acceptable; }

Problem coarse_problem(const Robot& robot, Random& random, Input input, double weight) {
  Problem problem = problem_of(robot);
  problem.step = 1e-2;
  problem.weight = weight;
  problem.input = input;
  const Vector from = random.vector(6, 0.8);
  problem.q_desired = testing::random_reference(random, 151, from, from + random.vector(6, 0.3), 0.05);
  return problem;
}

// Builds with sanitizers round otherwise (-O1): sample 11 ends at 1.6e-5 there.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kMostStationarity = 1e-4;
#else
constexpr double kMostStationarity = 1e-5;
#endif

// From weights that the flange does not feel to those that take it off the path by centimetres.
TEST(WeightContinuation, RandomPathsAreSolvedWithEitherInputAtAnyWeight) {
  Random random(81);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  int continued = 0;
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Input input = sample % 2 ? Input::jerk : Input::acceleration;
    const Problem problem = coarse_problem(robot, random, input, std::pow(10.0, -12.0 + sample / 2 % 6));
    const Motion motion = solve(problem, dynamics, {});
    EXPECT_TRUE(good(motion.status)) << "sample " << sample << ": " << nlp::status_name(motion.status) << ", "
                                     << motion.message;
    EXPECT_LT(motion.kkt.feasibility, 1e-10) << sample;
    EXPECT_LT(motion.kkt.stationarity, kMostStationarity) << sample;
    EXPECT_EQ(motion.kkt.sign, 0.0) << sample;
    continued += motion.iterations > 20;
  }
  EXPECT_GT(continued, 0);  // else the paths are too easy to say anything
}

TEST(WeightContinuation, FollowsTheSolutionUpToTheWeight) {
  Problem problem =
      coarse_problem(testing::racer(), *std::make_unique<Random>(82), Input::acceleration, 1e-6);
  std::vector<double> weights;
  // Solves only what lies near to its start.
  const Attempt attempt = [&](const Problem& weighed, const nlp::Solution* start, bool last) {
    weights.push_back(weighed.weight);
    EXPECT_EQ(last, weighed.weight == problem.weight);
    nlp::Solution solution;
    solution.iterations = 2;
    solution.point.x = Vector::Constant(1, std::log(weighed.weight));
    solution.point.lambda = Vector::Zero(1);
    const double from = start ? start->point.x[0] : std::log(1e-11);
    solution.status =
        std::abs(solution.point.x[0] - from) < std::log(30.0) ? Status::solved : Status::numerical_failure;
    return solution;
  };
  nlp::Solution failed;
  failed.iterations = 7;
  const nlp::Solution answer = continue_weight(problem, failed, attempt);
  EXPECT_EQ(answer.status, Status::solved);
  EXPECT_EQ(weights.back(), problem.weight);
  EXPECT_NEAR(answer.point.x[0], std::log(problem.weight), 1e-12);
  EXPECT_EQ(answer.iterations, 7 + 2 * static_cast<int>(weights.size()));
}

TEST(WeightContinuation, GivesBackTheFailureWhereNoWeightIsSolved) {
  const Problem problem = coarse_problem(testing::racer(), *std::make_unique<Random>(83), Input::jerk, 1e-6);
  nlp::Solution failed;
  failed.status = Status::numerical_failure;
  failed.message = "steps became too short";
  int count = 0;
  const nlp::Solution answer =
      continue_weight(problem, failed, [&](const Problem&, const nlp::Solution*, bool) {
        ++count;
        nlp::Solution solution;
        solution.status = Status::iteration_limit;
        return solution;
      });
  EXPECT_EQ(answer.status, Status::numerical_failure);
  EXPECT_EQ(answer.message, failed.message);
  EXPECT_LT(count, 10);
}

}  // namespace
}  // namespace exactarm::ocp
