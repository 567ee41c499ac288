#include "exactarm/ocp/first_order.hpp"

#include <gtest/gtest.h>

#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/transcription.hpp"
#include "racer.hpp"
#include "stagewise_point.hpp"

namespace exactarm::ocp {
namespace {

using testing::Random;
using testing::StagewisePoint;

TEST(FirstOrder, IsTheGradientOfTheTranscriptionsLagrangianAndItsEquations) {
  Random random(101);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  for (const Input input : {Input::acceleration, Input::jerk}) {
    Problem problem = problem_of(robot);
    problem.input = input;
    const Vector from = random.vector(6, 1.0);
    problem.q_desired = testing::random_reference(random, 15, from, from + random.vector(6, 0.1), 0.01);
    StagewisePoint at(problem, dynamics, random, 1e-3);
    const Layout& layout = at.model.layout();
    Transcription t(at.model);
    Vector expected(t.variables()), equations(t.constraints()), lambda(t.constraints());
    Vector low(t.variables()), high(t.variables());
    for (long k = 0; k < layout.knots; ++k) {
      lambda.segment(t.stage_row(k), 6) = at.point.stage.segment(6 * k, 6);
      if (k + 1 < layout.knots)
        lambda.segment(t.defect_row(k), layout.states()) =
            at.point.defect.segment(layout.states() * k, layout.states());
    }
    t.gradient(at.point.z, expected);
    expected *= StagewisePoint::kScale;
    const nlp::Sparsity& s = t.jacobian_sparsity();
    std::vector<double> values(static_cast<std::size_t>(s.size()));
    t.jacobian(at.point.z, values.data());
    for (long e = 0; e < s.size(); ++e) expected[s.column[e]] += values[e] * lambda[s.row[e]];
    t.constraint(at.point.z, equations);
    t.variable_bounds(low, high);

    const KktVector& found = at.conditions.residual();
    EXPECT_LT((found.z - expected).cwiseAbs().maxCoeff(), 1e-13 * expected.cwiseAbs().maxCoeff());
    for (long k = 0; k < layout.knots; ++k) {
      EXPECT_LT((found.stage.segment(6 * k, 6) - equations.segment(t.stage_row(k), 6)).norm(), 1e-14);
      if (k + 1 < layout.knots) {
        EXPECT_LT((found.defect.segment(layout.states() * k, layout.states()) -
                   equations.segment(t.defect_row(k), layout.states()))
                      .norm(),
                  1e-14);
      }
    }
    EXPECT_NEAR(at.conditions.largest_equation(), equations.cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_NEAR(at.conditions.owed(at.point), std::abs(equations.dot(lambda)), 1e-12);
    double largest = 0.0;
    for (long i = 0; i < expected.size(); ++i)
      if (low[i] < high[i]) largest = std::max(largest, std::abs(expected[i]));
    EXPECT_NEAR(at.conditions.stationarity(), largest, 1e-12 * largest);
  }
}

}  // namespace
}  // namespace exactarm::ocp
