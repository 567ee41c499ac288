#include "exactarm/ocp/line_search.hpp"

#include <gtest/gtest.h>

#include "stagewise_point.hpp"

namespace exactarm::ocp {
namespace {

using testing::StagewisePoint;
using testing::TwoMassesOnTheWay;

TEST(LineSearch, TakesWhatImprovesAndHalvesWhatDoesNot) {
  TwoMassesOnTheWay masses(105);
  StagewisePoint& at = masses.at;
  Direction& direction = masses.direction;
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
