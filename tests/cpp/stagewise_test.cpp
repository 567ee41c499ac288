#include "exactarm/ocp/stagewise.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "allocation_count.hpp"
#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/transcription.hpp"
#include "planning_cases.hpp"
#include "racer.hpp"

namespace exactarm::ocp {
namespace {

using nlp::Status;
using testing::LinearMasses;
using testing::Random;

struct Both {
  nlp::Solution own, ipopt;
  nlp::KktError error;
  double largest_difference, scale;
};

Both solve_both(const Problem& problem, const StageDynamics& dynamics) {
  const StageModel model(problem, dynamics, 2);
  Transcription transcription(model);
  Both both;
  both.own = solve_stagewise(model, {});
  both.scale = both.own.objective_scale;
  both.error = nlp::kkt_error(transcription, both.own.point, both.scale);
  nlp::IpoptOptions options;
  options.objective_scale = both.scale;
  options.first_barrier = 1e-3;
  options.feasibility = 1e-12;
  options.tolerance = std::max(options.tolerance, Objective(problem).gradient_floor(both.scale));
  both.ipopt = nlp::solve_ipopt(transcription, options);
  const Layout l = problem.layout();
  both.largest_difference = 0.0;
  for (long k = 0; k < l.knots; ++k)
    both.largest_difference = std::max(both.largest_difference, (both.own.point.x - both.ipopt.point.x)
                                                                    .segment(k * l.width(), l.axes)
                                                                    .cwiseAbs()
                                                                    .maxCoeff());
  return both;
}

void expect_agreement(const Both& both, const std::string& name) {
  ASSERT_EQ(both.own.status, Status::solved) << name << ": " << both.own.message;
  ASSERT_EQ(both.ipopt.status, Status::solved) << name << ": " << both.ipopt.message;
  EXPECT_LT(std::abs(both.own.objective - both.ipopt.objective), 1e-8 * both.ipopt.objective) << name;
  EXPECT_LT(both.largest_difference, 1e-9) << name;
  EXPECT_LT(both.error.feasibility, 1e-10) << name;
  EXPECT_LT(both.error.stationarity, 1e-5) << name;
  EXPECT_LT(both.error.complementarity, 1e-9) << name;
  EXPECT_EQ(both.error.sign, 0.0) << name;
}

// The closed-form answer of a linear-quadratic problem: one dense KKT system.
TEST(Stagewise, LinearQuadraticProblemHasItsClosedFormAnswer) {
  Random random(60);
  for (const Input input : {Input::acceleration, Input::jerk}) {
    const RowMatrix q = testing::random_reference(random, 40, Vector::Zero(2), Vector::Ones(2), 0.1);
    Problem problem = testing::mass_problem(q, 0.01, input == Input::jerk ? 1e-14 : 1e-10);
    problem.input = input;
    const LinearMasses dynamics((Vector(2) << 3.0, 12.0).finished());
    const StageModel model(problem, dynamics, 1);
    Transcription t(model);
    const nlp::Solution own = solve_stagewise(model, {});
    ASSERT_EQ(own.status, Status::solved) << own.message;
    EXPECT_LE(own.iterations, 2);
    const long n = t.variables(), m = t.constraints();
    Matrix kkt = Matrix::Zero(n + m, n + m);
    Vector right = Vector::Zero(n + m), low(n), high(n), zero = Vector::Zero(n), c(m), g(n);
    const auto& js = t.jacobian_sparsity();
    const auto& hs = t.hessian_sparsity();
    std::vector<double> jv(js.size()), hv(hs.size());
    t.jacobian(zero, jv.data());
    t.hessian(zero, 1.0, Vector::Zero(m), hv.data());
    for (long e = 0; e < js.size(); ++e)
      kkt(n + js.row[e], js.column[e]) = kkt(js.column[e], n + js.row[e]) = jv[e];
    for (long e = 0; e < hs.size(); ++e) kkt(hs.row[e], hs.column[e]) = kkt(hs.column[e], hs.row[e]) = hv[e];
    t.gradient(zero, g);
    t.constraint(zero, c);
    right << -g, -c;
    t.variable_bounds(low, high);
    for (long i = 0; i < n; ++i)
      if (low[i] == high[i]) {
        kkt.row(i).setZero();
        kkt(i, i) = 1.0;
        right[i] = low[i];
      }
    const Vector dense = kkt.fullPivLu().solve(right).head(n);
    EXPECT_LT((own.point.x - dense).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Stagewise, AgreesWithIpoptOnRandomPathsWithoutActiveBounds) {
  Random random(61);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  for (int sample = 0; sample < testing::samples() / 2; ++sample) {
    Problem problem = problem_of(robot);
    problem.step = 4e-3;
    problem.weight = std::pow(10.0, -14.0 + sample % 5);
    const Vector from = random.vector(6, 1.0);
    problem.q_desired = testing::random_reference(random, 151, from, from + random.vector(6, 0.1), 0.01);
    const Both both = solve_both(problem, dynamics);
    expect_agreement(both, "sample " + std::to_string(sample));
    EXPECT_LE(both.own.iterations, 6);
  }
}

TEST(Stagewise, AgreesWithIpoptOnRandomPathsWithActiveBounds) {
  Random random(62);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  for (int sample = 0; sample < testing::samples() / 2; ++sample) {
    Problem problem = problem_of(robot);
    problem.step = 4e-3;
    problem.weight = 1e-10;
    const Vector from = random.vector(6, 1.0);
    problem.q_desired = testing::random_reference(random, 101, from, from + random.vector(6, 0.3), 0.02);
    // The rate and the acceleration of one motor are held below what the reference asks for.
    const int axis = sample % 6;
    const double distance = std::abs(problem.q_desired(100, axis) - problem.q_desired(0, axis)) + 0.02;
    problem.bounds.theta_dot[axis] = 1.7 * distance / 0.4;
    problem.bounds.theta_ddot.setConstant(1e3);
    const Both both = solve_both(problem, dynamics);
    expect_agreement(both, "sample " + std::to_string(sample));
  }
}

TEST(Stagewise, IterationsAllocateNothing) {
  Random random(67);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  for (const Input input : {Input::acceleration, Input::jerk}) {
    Problem problem = problem_of(robot);
    problem.step = 4e-3;
    problem.weight = 1e-10;
    problem.input = input;
    const Vector from = random.vector(6, 1.0);
    problem.q_desired = testing::random_reference(random, 101, from, from + random.vector(6, 0.3), 0.02);
    problem.bounds.theta_dot.setConstant(1.7 * 0.3 / 0.4);  // active: predictor and corrector both run
    const StageModel model(problem, dynamics, 1);
    const auto allocations = [&](int iterations) {
      StagewiseOptions options;
      options.iterations = iterations;
      const long before = testing::allocation_count();
      const nlp::Solution solution = solve_stagewise(model, options);
      const long count = testing::allocation_count() - before;
      EXPECT_EQ(solution.status, Status::iteration_limit);
      return count;
    };
    allocations(1);  // workspaces of the dynamics are made once
    const long few = allocations(1);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // they have an operator new of their own
    EXPECT_GT(few, 0);
#endif
    EXPECT_EQ(allocations(5), few);
  }
}

TEST(Stagewise, InfeasibleProblemIsToldAsInfeasible) {
  Random random(63);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  Problem problem = problem_of(robot);
  problem.step = 4e-3;
  const Vector from = Vector::Zero(6);
  problem.q_desired = testing::random_reference(random, 101, from, from + Vector::Constant(6, 0.3), 0.0);
  problem.bounds.theta_dot[2] = 0.5;  // 0.3 rad in 0.4 s cannot be done at 0.5 rad/s
  const StageModel model(problem, dynamics, 1);
  const nlp::Solution own = solve_stagewise(model, {});
  EXPECT_EQ(own.status, Status::infeasible) << nlp::status_name(own.status) << " " << own.message;
  EXPECT_NE(own.message.find("joint"), std::string::npos);
}

TEST(Stagewise, EveryEndingHasAStatus) {
  const Problem problem = testing::mass_problem(
      testing::random_reference(*std::make_unique<Random>(64), 60, Vector::Zero(1), Vector::Ones(1), 0.1),
      0.01, 1e-10);
  const LinearMasses dynamics(Vector::Ones(1));
  const StageModel model(problem, dynamics, 1);
  StagewiseOptions options;
  options.iterations = 0;
  EXPECT_EQ(solve_stagewise(model, options).status, Status::iteration_limit);
  options.iterations = 50;
  options.seconds = 0.0;
  EXPECT_EQ(solve_stagewise(model, options).status, Status::time_limit);
  // Nothing to do: a path of length zero.
  Problem still = problem;
  still.q_desired.setConstant(0.3);
  const StageModel rest_model(still, dynamics, 1);
  const nlp::Solution solution = solve_stagewise(rest_model, {});
  EXPECT_EQ(solution.status, Status::solved);
  EXPECT_LT(solution.objective, 1e-20);
  // Dynamics that break down.
  class Broken : public LinearMasses {
    using LinearMasses::LinearMasses;
    void evaluate(const DynamicsBatch& batch, long first, long last, Workspace* workspace) const override {
      LinearMasses::evaluate(batch, first, last, workspace);
      if (batch.tau && first <= 30 && 30 < last) batch.tau[30] = std::nan("");
    }
  };
  const Broken broken(Vector::Ones(1));
  const StageModel broken_model(problem, broken, 1);
  EXPECT_EQ(solve_stagewise(broken_model, {}).status, Status::numerical_failure);
}

TEST(Stagewise, ThreadsGiveTheSameAnswer) {
  Random random(65);
  const Robot robot = testing::racer();
  const RobotDynamics dynamics(robot);
  Problem problem = problem_of(robot);
  const Vector from = random.vector(6, 1.0);
  problem.q_desired = testing::random_reference(random, 801, from, from + random.vector(6, 0.2), 0.01);
  const nlp::Solution one = solve_stagewise(StageModel(problem, dynamics, 1), {});
  const nlp::Solution two = solve_stagewise(StageModel(problem, dynamics, 2), {});
  EXPECT_EQ(one.status, Status::solved);
  EXPECT_LT((one.point.x - two.point.x).cwiseAbs().maxCoeff(), 1e-13);
}

}  // namespace
}  // namespace exactarm::ocp
