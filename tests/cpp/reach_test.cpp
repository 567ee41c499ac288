#include "exactarm/ocp/reach.hpp"

#include <gtest/gtest.h>

#include "exactarm/ocp/initial_guess.hpp"
#include "planning_cases.hpp"

namespace exactarm::ocp {
namespace {

using testing::LinearMasses;
using testing::Random;

std::string reach_of(double distance, double rate, double acceleration) {
  Random random(91);
  const RowMatrix q =
      testing::random_reference(random, 101, Vector::Zero(2), (Vector(2) << 0.1, distance).finished(), 0.0);
  Problem problem = testing::mass_problem(q, 0.01, 1e-10);
  problem.bounds.theta_dot.setConstant(rate);
  problem.bounds.theta_ddot.setConstant(acceleration);
  const LinearMasses dynamics(Vector::Ones(2));
  const StageModel model(problem, dynamics, 1);
  Vector z(problem.layout().unknowns());
  initial_guess(model, z.data());
  return out_of_reach(model, z.data());
}

// One second: v T at most, a T^2 / 4 without a limit of the rate, and v (T - v / a) with both.
TEST(Reach, EndsAreWhatRateAndAccelerationAllow) {
  const double none = std::numeric_limits<double>::infinity();
  EXPECT_EQ(reach_of(0.5, none, none), "");
  EXPECT_EQ(reach_of(0.489, 0.5, none), "");
  EXPECT_NE(reach_of(0.501, 0.5, none), "");
  EXPECT_EQ(reach_of(0.4999, none, 2.0), "");
  EXPECT_NE(reach_of(0.5001, none, 2.0), "");
  EXPECT_EQ(reach_of(0.3749, 0.5, 2.0), "");
  const std::string both = reach_of(0.3751, 0.5, 2.0);
  EXPECT_NE(both.find("joint 2"), std::string::npos) << both;
}

}  // namespace
}  // namespace exactarm::ocp
