#include "exactarm/ocp/line_search.hpp"

#include <gtest/gtest.h>

#include "exactarm/ocp/direction.hpp"
#include "stagewise_point.hpp"

namespace exactarm::ocp {
namespace {

using testing::LinearMasses;
using testing::Random;
using testing::StagewisePoint;

TEST(LineSearch, TakesWhatImprovesAndHalvesWhatDoesNot) {
  Random random(105);
  const Problem problem = testing::two_masses(random);
  const LinearMasses dynamics((Vector(2) << 3.0, 12.0).finished());
  StagewisePoint at(problem, dynamics, random, 0.1);
  Direction direction(at.model, at.objective, StagewisePoint::kScale, 1e-11);
  ASSERT_STREQ(direction.find(at.point, at.derivatives, at.conditions, at.barrier), "");
  KktVector residual = at.conditions.residual();
  residual.defect.setZero();  // the equation of motion alone: its residual is linear here
  const auto length = [&](double factor, double longest) {
    KktVector step = direction.step();
    step.z *= factor;
    LineSearch search(at.model, at.objective, 1e-30, 1);  // a scale at which the objective says nothing
    return search.accepted_length(at.point, residual, step, longest, at.workspace);
  };
  EXPECT_EQ(length(1.0, 1.0), 1.0);
  EXPECT_EQ(length(1.0, 0.3), 0.3);
  EXPECT_EQ(length(3.0, 1.0), 0.5);   // |1 - 3| > 1, |1 - 1.5| < 1
  EXPECT_EQ(length(-1.0, 1.0), std::pow(0.5, LineSearch::kMostHalvings));
}

}  // namespace
}  // namespace exactarm::ocp
