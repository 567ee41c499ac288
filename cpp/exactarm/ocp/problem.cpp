#include "exactarm/ocp/problem.hpp"

#include <limits>

namespace exactarm::ocp {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void require_shape(const std::string& name, const RowMatrix& matrix, const Problem& problem) {
  if (matrix.size() == 0) return;
  require_size("rows of " + name, matrix.rows(), problem.knots());
  require_size("columns of " + name, matrix.cols(), problem.axes());
  for (long k = 0; k < matrix.rows(); ++k)
    for (long i = 0; i < matrix.cols(); ++i)
      require_finite(name + ", knot " + std::to_string(k + 1) + ", axis " + std::to_string(i + 1),
                     matrix(k, i));
}

}  // namespace

Problem problem_of(const Robot& robot) {
  const long n = robot.axes();
  Problem problem;
  problem.q_offset.resize(n);
  Bounds& b = problem.bounds;
  for (Vector* v : {&b.q_min, &b.theta_min}) *v = Vector::Constant(n, -kInfinity);
  for (Vector* v : {&b.q_max, &b.q_dot, &b.theta_max, &b.theta_dot, &b.theta_ddot, &b.theta_dddot})
    *v = Vector::Constant(n, kInfinity);
  for (long i = 0; i < n; ++i) {
    const Joint& joint = robot.joint(i);
    const Limits& limits = joint.limits;
    problem.gears.push_back(joint.gear);
    problem.springs.push_back(joint.spring);
    problem.q_offset[i] = joint.q_offset;
    b.q_min[i] = limits.q_min;
    b.q_max[i] = limits.q_max;
    b.theta_min[i] = limits.q_min - joint.q_offset;
    b.theta_max[i] = limits.q_max - joint.q_offset;
    b.q_dot[i] = b.theta_dot[i] = limits.q_dot_max;
    b.theta_ddot[i] = limits.q_ddot_max;
  }
  return problem;
}

void require_problem(const Problem& problem) {
  const int n = problem.axes();
  if (n == 0) throw InvalidArgument("springs: found none, expected one an axis");
  require_size("columns of q_desired", problem.q_desired.cols(), n);
  if (problem.knots() < kLeastKnots)
    throw InvalidArgument("q_desired: found " + std::to_string(problem.knots()) +
                          " knots, expected at least " + std::to_string(kLeastKnots));
  require_positive("step", problem.step);
  require_positive("weight", problem.weight);
  require_shape("q_desired", problem.q_desired, problem);
  require_shape("direction", problem.direction, problem);
  require_shape("phi_shift", problem.phi_shift, problem);
  if (problem.direction.size() > 0 && problem.direction.cwiseAbs().maxCoeff() > 1.0)
    throw InvalidArgument("direction: expected values from -1 to 1");
  require_size("gears", problem.gears.size(), n);
  require_size("q_offset", problem.q_offset.size(), n);
  for (int i = 0; i < n; ++i) {
    const std::string joint = "joint " + std::to_string(i + 1);
    require_positive("spring of " + joint + ", linear (a rigid joint needs no optimal control)",
                     problem.springs[i].linear);
    if (!(problem.springs[i].cubic >= 0.0))
      throw InvalidArgument("spring of " + joint + ", cubic: expected at least 0, found " +
                            std::to_string(problem.springs[i].cubic));
    require_gear("gear of " + joint + ", cw", problem.gears[i].ratio, problem.gears[i].cw);
    require_gear("gear of " + joint + ", ccw", problem.gears[i].ratio, problem.gears[i].ccw);
  }
  const Bounds& b = problem.bounds;
  for (const Vector* v : {&b.q_min, &b.q_max, &b.q_dot, &b.theta_min, &b.theta_max, &b.theta_dot,
                          &b.theta_ddot, &b.theta_dddot})
    require_size("bounds", v->size(), n);
  for (int i = 0; i < n; ++i)
    if (!(b.q_min[i] < b.q_max[i]) || !(b.q_dot[i] > 0) || !(b.theta_min[i] < b.theta_max[i]) ||
        !(b.theta_dot[i] > 0) || !(b.theta_ddot[i] > 0) || !(b.theta_dddot[i] > 0))
      throw InvalidArgument("bounds of joint " + std::to_string(i + 1) + ": empty range");
}

void knot_bounds(const Problem& problem, VectorRef low, VectorRef high) {
  const Layout layout = problem.layout();
  const int n = layout.axes;
  const Bounds& b = problem.bounds;
  const double h = problem.step;
  low.setConstant(-kInfinity);
  high.setConstant(kInfinity);
  const auto range = [&](int block, const Vector& least, const Vector& most, double factor) {
    low.segment(block * n, n) = factor * least;
    high.segment(block * n, n) = factor * most;
  };
  range(kQ, b.q_min, b.q_max, 1.0);
  range(kQDot, -b.q_dot, b.q_dot, h);
  range(kTheta, b.theta_min, b.theta_max, 1.0);
  range(kThetaDot, -b.theta_dot, b.theta_dot, h);
  range(kThetaDdot, -b.theta_ddot, b.theta_ddot, h * h);
  if (problem.input == Input::jerk) range(layout.input(), -b.theta_dddot, b.theta_dddot, h * h * h);
}

}  // namespace exactarm::ocp
