#include "exactarm/ocp/ending.hpp"

#include <gtest/gtest.h>

#include "stagewise_point.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;
using testing::LinearMasses;
using testing::Random;
using testing::StagewisePoint;

class EndingTest : public ::testing::Test {
 protected:
  bool reached(Ending& ending) {
    return ending.reached(at.point, at.conditions, at.barrier, 100.0, solution);
  }

  Random random{106};
  const Problem problem = testing::two_masses(random);
  const LinearMasses dynamics{(Vector(2) << 3.0, 12.0).finished()};
  StagewisePoint at{problem, dynamics, random, 0.1};
  StagewiseOptions options;
  nlp::Solution solution;
};

TEST_F(EndingTest, EightShortStepsInARowEndIt) {
  Ending ending(at.model, options, true);
  for (int step = 0; step < 7; ++step) ending.count_step(1e-4, false);
  EXPECT_FALSE(reached(ending));
  ending.count_step(0.5, false);
  for (int step = 0; step < 7; ++step) ending.count_step(1e-4, false);
  EXPECT_FALSE(reached(ending));
  ending.count_step(1e-4, false);
  EXPECT_TRUE(reached(ending));
  EXPECT_EQ(solution.status, Status::numerical_failure);
  EXPECT_EQ(solution.message, "steps became too short");
}

TEST_F(EndingTest, HardStepsAreCountedOnlyWhereTheStartLiesInside) {
  options.hard_steps = 2;
  for (const bool inside : {false, true}) {
    Ending ending(at.model, options, inside);
    for (int step = 0; step < 3; ++step) ending.count_step(1.0, true);
    EXPECT_EQ(reached(ending), inside);
  }
}

TEST_F(EndingTest, AValueThatIsNotFiniteEndsIt) {
  at.derivatives.residual[5] = std::nan("");
  at.conditions.evaluate(at.point, at.derivatives, at.barrier);
  Ending ending(at.model, options, true);
  EXPECT_TRUE(reached(ending));
  EXPECT_EQ(solution.message, "a value is not finite");
}

}  // namespace
}  // namespace exactarm::ocp
