// Analytic starts of the inverse kinematics for an arm with one axis across two parallel ones and
// three wrist axes that meet in one point (Pieper 1968), on the geometry with twists rounded to
// right angles and beta = 0.
#include "exactarm/base/rotation.hpp"
#include "exactarm/robot/inverse_kinematics.hpp"
#include "exactarm/robot/kinematics.hpp"

namespace exactarm {
namespace {

constexpr double kTwistTolerance = 0.1;     // rad away from a right angle
constexpr double kOffsetTolerance = 0.01;   // m between wrist axes

bool rounded_twist(double alpha, int& quarter_turns) {
  const double quarters = std::round(alpha / (0.5 * M_PI));
  quarter_turns = (static_cast<int>(std::fmod(quarters, 4.0)) + 4) % 4;
  return std::abs(alpha - quarters * 0.5 * M_PI) < kTwistTolerance;
}

// Quarter turns of the twists 1 to 6 when the arm is of this kind.
bool is_spherical_wrist_arm(const Robot& robot, int (&twist)[6]) {
  if (robot.axes() != 6) return false;
  for (int i = 0; i < 6; ++i) {
    if (robot.joint(i).frame.type != JointType::revolute) return false;
    if (!rounded_twist(robot.joint(i).frame.alpha, twist[i]) && i < 5) return false;
  }
  const auto across = [&](int i) { return twist[i] % 2 == 1; };
  const Frame &f4 = robot.joint(3).frame, &f5 = robot.joint(4).frame;
  return across(0) && !across(1) && across(3) && across(4) && std::abs(f4.a) < kOffsetTolerance &&
         std::abs(f5.a) < kOffsetTolerance && std::abs(f5.d) < kOffsetTolerance;
}

double clamped(double value) { return std::min(std::max(value, -1.0), 1.0); }

}  // namespace

std::vector<Vector> spherical_wrist_starts(const Robot& robot, const Pose& target) {
  std::vector<Vector> starts;
  int twist[6];
  if (!is_spherical_wrist_arm(robot, twist)) return starts;
  Frame f[6];
  for (int i = 0; i < 6; ++i) f[i] = robot.joint(i).frame;
  const auto angle = [&](int i) { return 0.5 * M_PI * twist[i]; };
  const auto rounded_sin = [&](int i) { return std::round(std::sin(angle(i))); };
  const auto rounded_cos = [&](int i) { return std::round(std::cos(angle(i))); };

  // Flange and wrist centre in the base frame; the last frame keeps its true twist.
  const Matrix3 base_turn = robot.base().rotation.transpose();
  const Matrix3 flange = base_turn * target.rotation * robot.tool().rotation.transpose();
  const Vector3 origin =
      base_turn * (target.position - robot.base().position) - flange * robot.tool().position;
  const Matrix3 before_six = flange * (rotation_x(f[5].alpha) * rotation_y(f[5].beta)).transpose();
  // Trans_x(a_6) comes after Rot_z(q_6), so it lies along x of `before_six`.
  const Vector3 wrist = origin - before_six.col(2) * f[5].d - before_six.col(0) * f[5].a;

  // The wrist centre as seen from axis 3 before it turns, and the constant height over the plane of the arm.
  const double s1 = rounded_sin(0), c2 = rounded_cos(1), s3 = rounded_sin(2), c3 = rounded_cos(2);
  const double cx = f[2].a, cy = -s3 * f[3].d, reach = std::hypot(cx, cy), gamma = std::atan2(cy, cx);
  const double height = f[1].d + c2 * (f[2].d + c3 * f[3].d);
  const double radius = std::sqrt(std::max(wrist.head<2>().squaredNorm() - height * height, 0.0));

  for (double shoulder : {1.0, -1.0}) {
    const double along = shoulder * radius, x = along - f[0].a, y = s1 * (wrist.z() - f[0].d);
    const double t1 = std::atan2(wrist.y(), wrist.x()) - std::atan2(-s1 * height, along);
    const double cosine = (x * x + y * y - f[1].a * f[1].a - reach * reach) / (2.0 * f[1].a * reach);
    for (double elbow : {1.0, -1.0}) {
      const double opening = elbow * std::acos(clamped(cosine)), t3 = opening - gamma;
      const double t2 = std::atan2(y, x) - std::atan2(c2 * reach * std::sin(opening),
                                                      f[1].a + reach * std::cos(opening));
      const Matrix3 third = rotation_z(t1) * rotation_x(angle(0)) * rotation_z(t2) * rotation_x(angle(1)) *
                            rotation_z(t3) * rotation_x(angle(2));
      // Rot_z(t4) Rot_y(-s4 t5) Rot_z(t6) times a rest of no or half a turn about x.
      const double s4 = rounded_sin(3), half = angle(3) + angle(4);
      const Matrix3 m = third.transpose() * before_six * rotation_x(half).transpose();
      const double t6_sign = std::round(std::cos(half));
      for (double flip : {1.0, -1.0}) {
        const double tilt = flip * std::atan2(std::hypot(m(0, 2), m(1, 2)), m(2, 2));
        double t4 = std::atan2(flip * m(1, 2), flip * m(0, 2)),
               t6 = std::atan2(flip * m(2, 1), -flip * m(2, 0));
        if (std::hypot(m(0, 2), m(1, 2)) < 1e-9) {
          t4 = 0.0;
          t6 = std::atan2(m(1, 0), m(1, 1));
        }
        const double turns[6] = {t1, t2, t3, t4, -s4 * tilt, t6_sign * t6};
        Vector q(6);
        for (int i = 0; i < 6; ++i) q[i] = f[i].sign * std::remainder(turns[i] - f[i].zero, 2.0 * M_PI);
        starts.push_back(q);
      }
    }
  }
  return starts;
}

}  // namespace exactarm
