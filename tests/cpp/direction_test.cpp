#include "exactarm/ocp/direction.hpp"

#include <gtest/gtest.h>

#include "stagewise_point.hpp"

namespace exactarm::ocp {
namespace {

using testing::StagewisePoint;
using testing::TwoMassesOnTheWay;

TEST(Direction, WholeStepSolvesALinearProblem) {
  TwoMassesOnTheWay masses(102);
  StagewisePoint& at = masses.at;
  Direction& direction = masses.direction;
  const double before = at.conditions.stationarity();
  ASSERT_STREQ(direction.find(at.point, at.derivatives, at.conditions, at.barrier), "");
  EXPECT_FALSE(direction.indefinite());
  EXPECT_EQ(direction.primal(), 1.0);
  at.point.z += direction.step().z;
  at.point.stage += direction.step().stage;
  at.point.defect += direction.step().defect;
  at.evaluate();
  EXPECT_LT(at.conditions.largest_equation(), 1e-13);
  EXPECT_LT(at.conditions.stationarity(), 1e-12 * before);
}

TEST(Direction, IndefiniteHessianIsDampedAndTheNextDefiniteOneIsNot) {
  TwoMassesOnTheWay masses(103);
  StagewisePoint& at = masses.at;
  Direction& direction = masses.direction;
  StageDerivatives concave = at.derivatives;
  for (long entry = 0; entry < concave.q_q.size(); entry += 4)
    concave.q_q[entry] = concave.q_q[entry + 3] = -1e3 * StagewisePoint::kScale;
  ASSERT_STREQ(direction.find(at.point, concave, at.conditions, at.barrier), "");
  EXPECT_TRUE(direction.damped());
  ASSERT_STREQ(direction.find(at.point, at.derivatives, at.conditions, at.barrier), "");
  EXPECT_FALSE(direction.damped());
}

TEST(Direction, BoundsShortenTheStep) {
  TwoMassesOnTheWay masses(104);
  StagewisePoint& at = masses.at;
  Direction& direction = masses.direction;
  Vector low = Vector::Constant(at.point.z.size(), -1e20), high = at.point.z.array() + 1e-3;
  high.head(at.model.layout().width()).setConstant(1e20);
  high.tail(at.model.layout().width()).setConstant(1e20);
  at.barrier = Barrier(low, high);
  at.barrier.start(at.point.z, 1e-3);
  at.evaluate();
  ASSERT_STREQ(direction.find(at.point, at.derivatives, at.conditions, at.barrier), "");
  EXPECT_LT(direction.primal(), 1.0);
  EXPECT_GT(direction.primal(), 0.0);
  at.barrier.move(direction.primal(), direction.dual());
  EXPECT_GT(at.barrier.average(), 0.0);
}

}  // namespace
}  // namespace exactarm::ocp
