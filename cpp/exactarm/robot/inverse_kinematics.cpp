#include "exactarm/robot/inverse_kinematics.hpp"

#include <Eigen/QR>
#include <random>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/base/rotation.hpp"
#include "exactarm/robot/kinematics.hpp"

namespace exactarm {
namespace {

constexpr double kLongestStep = 0.5;  // rad or m, keeps a far start on its branch
constexpr int kRandomStarts = 200;
constexpr double kSameSolution = 1e-6;
constexpr int kIterationsBetweenChecks = 64;  // for a signal; once a pose of a path

using Status = InverseKinematicsStatus;

// Pose, Jacobian and its factorisation at one q; reused over a whole path.
class Solver {
 public:
  Solver(const Robot& robot, const InverseKinematicsOptions& options)
      : robot_(robot), options_(options), n_(robot.axes()), row_(1, n_), jacobian_(6, n_), qr_(n_, 6) {}

  // Newton from q; the error left over and the conditioning of the last Jacobian.
  Status solve(const Pose& target, VectorRef q, double& left_over, double& conditioning, long& iterations) {
    const Vector nearest = q;
    double before = std::numeric_limits<double>::infinity();
    conditioning = 1.0;
    left_over = 0.0;
    for (int iteration = 0; iteration < options_.iterations; ++iteration, ++iterations) {
      if (iteration % kIterationsBetweenChecks == 0) check_interrupt();
      Vector6 error = evaluate(target, q);
      left_over = error.norm();
      if (!std::isfinite(left_over)) return Status::not_finite;
      // At rounding the error stops falling; that is as near as the arithmetic comes.
      const bool settled =
          left_over <= options_.tolerance || (left_over <= 1e-9 && left_over >= 0.5 * before);
      if (settled && (n_ <= 6 || iteration > 0)) {
        if (n_ >= 6) factorise(conditioning);
        return Status::solved;
      }
      before = left_over;
      Vector step = least_step(error, nearest - q, conditioning);
      const double longest = step.cwiseAbs().maxCoeff();
      if (!std::isfinite(longest)) return Status::singular;
      if (longest > kLongestStep) step *= kLongestStep / longest;
      q += step;
    }
    return conditioning < options_.singular ? Status::singular : Status::unreachable;
  }

 private:
  Vector6 evaluate(const Pose& target, const VectorRef& q) {
    row_ = q.transpose();
    Vector3 position;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation;
    KinematicsBatch out;
    out.position = position.data();
    out.rotation = rotation.data();
    out.jacobian = jacobian_.data();
    kinematics_batch(robot_, row_, RowMatrix(), out, 1);
    const Matrix3 turn = target.rotation * rotation.transpose();
    Vector6 error;
    error.head<3>() = target.position - position;
    // The exact logarithm only where the turn is not small; below, its skew part agrees to third order.
    const Vector3 skew_part(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
    if (turn.trace() > 3.0 - 1e-8)
      error.tail<3>() = 0.5 * skew_part;
    else
      error.tail<3>() = rotation_log(turn);
    return error;
  }

  void factorise(double& conditioning) {
    qr_.compute(jacobian_.transpose());
    conditioning = std::abs(qr_.matrixR()(5, 5) / qr_.matrixR()(0, 0));
  }

  // J^+ e + (I - J^+ J) towards, from J' P = Q R.
  Vector least_step(const Vector6& error, const Vector& towards, double& conditioning) {
    if (n_ < 6) {
      const Eigen::ColPivHouseholderQR<Matrix> qr(jacobian_);
      conditioning = std::abs(qr.matrixR()(n_ - 1, n_ - 1) / qr.matrixR()(0, 0));
      return qr.solve(error);
    }
    factorise(conditioning);
    const auto& r = qr_.matrixR();
    Vector6 target = error;
    if (n_ > 6) target -= jacobian_ * towards;
    Vector6 inner = qr_.colsPermutation().transpose() * target;
    r.topLeftCorner<6, 6>().triangularView<Eigen::Upper>().transpose().solveInPlace(inner);
    Vector step = Vector::Zero(n_);
    step.head<6>() = inner;
    step.applyOnTheLeft(qr_.householderQ().setLength(6));
    if (n_ > 6) step += towards;
    return step;
  }

  const Robot& robot_;
  const InverseKinematicsOptions& options_;
  const long n_;
  RowMatrix row_;
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor> jacobian_;
  Eigen::ColPivHouseholderQR<Matrix> qr_;
};

// First joint beyond its limit, or -1.
int beyond_limit(const Robot& robot, const VectorRef& q, double& limit) {
  for (long i = 0; i < robot.axes(); ++i) {
    const Limits& limits = robot.joint(i).limits;
    limit = q[i] < limits.q_min ? limits.q_min : limits.q_max;
    if (q[i] < limits.q_min || q[i] > limits.q_max) return static_cast<int>(i);
  }
  return -1;
}

void check_limits(const Robot& robot, const VectorRef& q, InverseKinematicsReport& report) {
  double limit = 0.0;
  const int joint = beyond_limit(robot, q, limit);
  if (joint < 0) return;
  report.status = Status::joint_limit;
  report.joint = joint;
  report.value = q[joint];
  report.limit = limit;
}

// Joints without limits turn around 0.
double middle_of(const Limits& limits) {
  const double middle = 0.5 * (limits.q_min + limits.q_max);
  return std::isfinite(middle) ? middle : 0.0;
}

// Whole turns that bring a revolute joint inside its limits.
void turn_inside(const Robot& robot, VectorRef q) {
  for (long i = 0; i < robot.axes(); ++i) {
    if (robot.joint(i).frame.type != JointType::revolute) continue;
    const double middle = middle_of(robot.joint(i).limits);
    q[i] -= 2.0 * M_PI * std::round((q[i] - middle) / (2.0 * M_PI));
  }
}

std::vector<Vector> random_starts(const Robot& robot) {
  std::mt19937_64 engine(1);
  std::vector<Vector> starts;
  for (int sample = 0; sample < kRandomStarts; ++sample) {
    Vector q(robot.axes());
    for (long i = 0; i < q.size(); ++i) {
      const Limits& limits = robot.joint(i).limits;
      const bool limited = std::isfinite(limits.q_max - limits.q_min);
      q[i] = std::uniform_real_distribution<double>(limited ? limits.q_min : -M_PI,
                                                    limited ? limits.q_max : M_PI)(engine);
    }
    starts.push_back(q);
  }
  return starts;
}

double distance_from_middle(const Robot& robot, const Vector& q) {
  double sum = 0.0;
  for (long i = 0; i < robot.axes(); ++i) {
    const double range = robot.joint(i).limits.q_max - robot.joint(i).limits.q_min;
    sum += std::pow((q[i] - middle_of(robot.joint(i).limits)) /
                        (std::isfinite(range) ? std::max(range, 1e-12) : 2.0 * M_PI),
                    2);
  }
  return sum;
}

}  // namespace

InverseKinematicsReport inverse_kinematics(const Robot& robot, const Pose& target, VectorRef q,
                                           const InverseKinematicsOptions& options) {
  require_size("q", q.size(), robot.axes());
  Solver solver(robot, options);
  InverseKinematicsReport report;
  report.status = solver.solve(target, q, report.value, report.conditioning, report.iterations);
  if (report.status == Status::solved && options.check_limits) check_limits(robot, q, report);
  if (report.status != Status::solved) report.index = 0;
  return report;
}

InverseKinematicsReport inverse_kinematics_path(const Robot& robot, ConstRowMatrixRef positions,
                                                ConstRowMatrixRef rotations, ConstVectorRef start,
                                                RowMatrix& q, const InverseKinematicsOptions& options) {
  require_size("columns of positions", positions.cols(), 3);
  require_size("columns of rotations", rotations.cols(), 9);
  require_size("rows of rotations", rotations.rows(), positions.rows());
  require_size("start", start.size(), robot.axes());
  q.setConstant(positions.rows(), robot.axes(), std::numeric_limits<double>::quiet_NaN());
  Solver solver(robot, options);
  InverseKinematicsReport report;
  Vector guess = start, solution(robot.axes());
  for (long k = 0; k < positions.rows(); ++k) {
    if (k == 1 || (k > 1 && !options.extrapolate))
      guess = q.row(k - 1);
    else if (k == 2)
      guess = 2.0 * q.row(1) - q.row(0);
    else if (k >= 3)
      guess = 3.0 * (q.row(k - 1) - q.row(k - 2)) + q.row(k - 3);
    Pose target;
    target.position = positions.row(k).transpose();
    target.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotations.row(k).data());
    solution = guess;
    double conditioning, left_over;
    report.status = solver.solve(target, solution, left_over, conditioning, report.iterations);
    report.value = left_over;
    if (conditioning < report.conditioning) {
      report.conditioning = conditioning;
      report.conditioning_index = k;
    }
    if (report.status == Status::solved && k > 0 &&
        (solution - guess).cwiseAbs().maxCoeff() > options.largest_jump)
      report.status = Status::singular;
    if (report.status == Status::solved && report.conditioning < options.singular)
      report.status = Status::singular;
    if (report.status == Status::solved && options.check_limits) check_limits(robot, solution, report);
    if (report.status != Status::solved) {
      report.index = k;
      break;
    }
    q.row(k) = solution.transpose();
  }
  return report;
}

std::vector<Vector> inverse_kinematics_branches(const Robot& robot, const Pose& target,
                                                const InverseKinematicsOptions& options) {
  std::vector<Vector> starts = spherical_wrist_starts(robot, target);
  if (starts.empty()) starts = random_starts(robot);
  InverseKinematicsOptions unlimited = options;
  unlimited.check_limits = false;
  std::vector<Vector> branches;
  for (Vector q : starts) {
    if (inverse_kinematics(robot, target, q, unlimited).status != Status::solved) continue;
    turn_inside(robot, q);
    double limit;
    if (options.check_limits && beyond_limit(robot, q, limit) >= 0) continue;
    const auto same = [&](const Vector& other) { return (other - q).cwiseAbs().maxCoeff() < kSameSolution; };
    if (std::none_of(branches.begin(), branches.end(), same)) branches.push_back(q);
  }
  std::sort(branches.begin(), branches.end(), [&](const Vector& a, const Vector& b) {
    return distance_from_middle(robot, a) < distance_from_middle(robot, b);
  });
  return branches;
}

}  // namespace exactarm
