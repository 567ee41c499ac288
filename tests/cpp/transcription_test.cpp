#include "exactarm/ocp/transcription.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "exactarm/nlp/ipopt.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "exactarm/ocp/robot_dynamics.hpp"
#include "planning_cases.hpp"
#include "racer.hpp"

namespace exactarm::ocp {
namespace {

using testing::Random;

Problem random_problem(Random& random, const Robot& robot, long knots, Input input) {
  const long n = robot.axes();
  Problem problem = problem_of(robot);
  problem.input = input;
  problem.step = 2e-3;
  problem.weight = 1e-12;
  const Vector from = random.vector(n, 1.0);
  problem.q_desired = testing::random_reference(random, knots, from, from + random.vector(n, 0.3), 0.05);
  problem.direction.resize(knots, n);
  problem.phi_shift.resize(knots, n);
  for (long e = 0; e < knots * n; ++e) {
    problem.direction.data()[e] = random.uniform(-1, 1);
    problem.phi_shift.data()[e] = random.uniform(-1e-3, 1e-3);
  }
  return problem;
}

Matrix dense_jacobian(nlp::Problem& problem, const Vector& x) {
  Matrix dense = Matrix::Zero(problem.constraints(), problem.variables());
  const nlp::Sparsity& s = problem.jacobian_sparsity();
  std::vector<double> values(s.size());
  problem.jacobian(x, values.data());
  for (long e = 0; e < s.size(); ++e) dense(s.row[e], s.column[e]) += values[e];
  return dense;
}

Matrix dense_hessian(nlp::Problem& problem, const Vector& x, double factor, const Vector& lambda) {
  Matrix dense = Matrix::Zero(problem.variables(), problem.variables());
  const nlp::Sparsity& s = problem.hessian_sparsity();
  std::vector<double> values(s.size());
  problem.hessian(x, factor, lambda, values.data());
  for (long e = 0; e < s.size(); ++e) {
    EXPECT_GE(s.row[e], s.column[e]);
    dense(s.row[e], s.column[e]) += values[e];
    if (s.row[e] != s.column[e]) dense(s.column[e], s.row[e]) += values[e];
  }
  return dense;
}

TEST(Transcription, DerivativesMatchCentralDifference) {
  Random random(40);
  for (int sample = 0; sample < 4; ++sample) {
    const bool racer = sample < 2;
    const Robot robot = racer ? testing::racer() : testing::random_robot(random, 3, true);
    const Problem problem =
        random_problem(random, robot, kLeastKnots, sample % 2 ? Input::jerk : Input::acceleration);
    const RobotDynamics dynamics(robot);
    const StageModel model(problem, dynamics, 1);
    Transcription nlp(model);
    Vector x(nlp.variables());
    nlp.start(x);
    x += random.vector(x.size(), 1e-3);
    const Vector lambda = random.vector(nlp.constraints(), 1.0);
    const auto constraint = [&](const Vector& point) {
      Vector c(nlp.constraints());
      nlp.constraint(point, c);
      return c;
    };
    testing::expect_derivative(constraint, x, dense_jacobian(nlp, x), 1e-7, 1e-5);
    const auto objective = [&](const Vector& point) { return Vector::Constant(1, nlp.objective(point)); };
    Vector gradient(x.size());
    nlp.gradient(x, gradient);
    testing::expect_derivative(objective, x, gradient.transpose(), 1e-7, 1e-3);
    const auto lagrangian_gradient = [&](const Vector& point) {
      Vector g(x.size());
      nlp.gradient(point, g);
      return Vector(0.7 * g + dense_jacobian(nlp, point).transpose() * lambda);
    };
    testing::expect_derivative(lagrangian_gradient, x, dense_hessian(nlp, x, 0.7, lambda), 1e-6, 1e-5);
  }
}

TEST(Transcription, GuessSolvesTheEquationOfMotionAndNearlyTheDefects) {
  const Robot robot = testing::racer();
  Random random(41);
  Problem problem = random_problem(random, robot, 501, Input::acceleration);
  problem.direction.resize(0, 0);
  problem.phi_shift.resize(0, 0);
  const RobotDynamics dynamics(robot);
  const StageModel model(problem, dynamics, 2);
  Transcription nlp(model);
  Vector x(nlp.variables()), c(nlp.constraints());
  nlp.start(x);
  nlp.constraint(x, c);
  for (long k = 0; k < 501; ++k) EXPECT_LT(c.segment(nlp.stage_row(k), 6).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT(c.cwiseAbs().maxCoeff(), 1e-3);
}

TEST(Transcription, IpoptTracksASmoothReferenceOfTheRacer) {
  const Robot robot = testing::racer();
  Random random(42);
  Problem problem = random_problem(random, robot, 301, Input::acceleration);
  problem.weight = 1e-14;
  const Vector from = random.vector(6, 1.0);
  problem.q_desired = testing::random_reference(random, 301, from, from + random.vector(6, 0.1), 0.01);
  problem.direction.resize(0, 0);
  problem.phi_shift.resize(0, 0);
  const RobotDynamics dynamics(robot);
  const StageModel model(problem, dynamics, 2);
  Transcription nlp(model);
  nlp::IpoptOptions options;
  options.objective_scale = 1e8;
  const nlp::Solution solution = nlp::solve_ipopt(nlp, options);
  EXPECT_EQ(solution.status, nlp::Status::solved) << solution.message;
  const nlp::KktError error = nlp::kkt_error(nlp, solution.point, options.objective_scale);
  EXPECT_LT(error.feasibility, 1e-9);
  EXPECT_LT(error.stationarity, 1e-5);
  EXPECT_LT(error.sign, 1e-12);
  double worst = 0.0;
  for (long k = 0; k < 301; ++k)
    worst =
        std::max(worst, (solution.point.x.segment(k * 36, 6) - problem.q_desired.row(k).transpose()).norm());
  std::printf("%d iterations, %.3f s, objective %.3e, worst %.2e rad, KKT %.1e %.1e %.1e\n",
              solution.iterations, solution.seconds, solution.objective, worst, error.stationarity,
              error.feasibility, error.complementarity);
  EXPECT_LT(worst, 1e-5);
}

TEST(Transcription, Ma27IsRefusedWithAReasonWhereItIsMissing) {
  std::string reason;
  if (nlp::ma27_available(&reason)) GTEST_SKIP() << "an HSL library is installed here";
  EXPECT_NE(reason.find("HSL"), std::string::npos);
  Problem problem = testing::mass_problem(RowMatrix::Zero(kLeastKnots, 1), 1e-3, 1e-10);
  const testing::LinearMasses dynamics(Vector::Ones(1));
  const StageModel model(problem, dynamics, 1);
  Transcription nlp(model);
  nlp::IpoptOptions options;
  options.linear_solver = "ma27";
  EXPECT_THROW(nlp::solve_ipopt(nlp, options), InvalidArgument);
}

TEST(Transcription, RefusesBadProblemsByName) {
  const testing::LinearMasses dynamics(Vector::Ones(2));
  const auto refused = [&](Problem problem, const std::string& word) {
    try {
      StageModel(problem, dynamics, 1);
    } catch (const InvalidArgument& error) {
      EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
      return;
    }
    FAIL() << "accepted: " << word;
  };
  const Problem good = testing::mass_problem(RowMatrix::Zero(50, 2), 1e-3, 1e-10);
  Problem bad = good;
  bad.q_desired = RowMatrix::Zero(1, 2);
  refused(bad, "knots");
  bad = good;
  bad.q_desired(7, 1) = std::nan("");
  refused(bad, "knot 8, axis 2");
  bad = good;
  bad.springs[1].linear = 0.0;
  refused(bad, "joint 2");
  bad = good;
  bad.step = -1.0;
  refused(bad, "step");
}

}  // namespace
}  // namespace exactarm::ocp
