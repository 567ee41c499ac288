#include "exactarm/robot/gear.hpp"

#include <limits>

namespace exactarm {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr int kMostIterations = 200;
constexpr double kRange = 4.0 * M_PI;
// Harmonics evaluated before a proof of monotony is given up: 0.1 s. The finest real gear (order 500, an
// amplitude of 1.001) takes 5e4 steps.
constexpr long kMostEvaluations = 5000000;

// (Xi / ratio - phi, u / ratio - 1) at phi.
inline void relative(const GearTable& table, double phi, double& angle, double& slope) {
  angle = slope = 0.0;
  for (long j = 0; j < table.size(); ++j) {
    const double w = table.order()[j], s = std::sin(w * phi), c = std::cos(w * phi);
    angle += (table.a()[j] * s + table.b()[j] * (c - 1.0)) / w;
    slope += table.a()[j] * c - table.b()[j] * s;
  }
}

// Largest |Xi / ratio - phi| that the coefficients allow.
inline double farthest(const GearTable& table) {
  double sum = 0.0;
  for (long j = 0; j < table.size(); ++j)
    sum += (std::hypot(table.a()[j], table.b()[j]) + std::abs(table.b()[j])) / table.order()[j];
  return sum;
}

// phi + angle(phi) = target, where |angle| <= margin, by Newton with a bisection guard.
template <class Relative>
double invert(const Relative& function, double target, double margin, double guess) {
  if (margin == 0.0) return target;
  // The harmonics cannot move the angle by more than the margin, so the bracket holds a root.
  const double tolerance = 4.0 * kEpsilon * std::max(1.0, std::abs(target));
  double low = target - margin - tolerance, high = target + margin + tolerance;
  double phi = std::min(std::max(guess, low), high), last_step = high - low;
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    double angle, slope;
    function(phi, angle, slope);
    const double error = phi + angle - target;
    (error > 0.0 ? high : low) = phi;
    double step = -error / (1.0 + slope);
    const bool newton = 1.0 + slope > 0.0 && phi + step >= low && phi + step <= high &&
                        std::abs(step) <= 0.5 * std::abs(last_step);
    if (!newton) step = 0.5 * (low + high) - phi;
    phi += step;
    last_step = step;
    if (std::abs(step) <= tolerance) break;
  }
  return phi;
}

}  // namespace

void gear_derivatives(double ratio, const GearTable& table, double phi, int highest, GearDerivatives& out) {
  double sum[5] = {phi, 1.0, 0.0, 0.0, 0.0};
  for (long j = 0; j < table.size(); ++j) {
    const double w = table.order()[j], a = table.a()[j], b = table.b()[j];
    const double s = std::sin(w * phi), c = std::cos(w * phi);
    const double even = a * c - b * s, odd = a * s + b * c;
    sum[0] += (odd - b) / w;
    sum[1] += even;
    sum[2] -= w * odd;
    sum[3] -= w * w * even;
    sum[4] += w * w * w * odd;
  }
  for (int k = 0; k <= highest; ++k) out.value[k] = ratio * sum[k];
}

double gear_motor_angle(double ratio, const GearTable& table, double phi) {
  double angle, slope;
  relative(table, phi, angle, slope);
  return ratio * (phi + angle);
}

double gear_ratio(double ratio, const GearTable& table, double phi, int order) {
  if (order < 0 || order > 3)
    throw InvalidArgument("derivative order of the gear ratio: found " + std::to_string(order) +
                          ", expected 0 to 3");
  GearDerivatives derivatives;
  gear_derivatives(ratio, table, phi, order + 1, derivatives);
  return derivatives.value[order + 1];
}

double gear_output_angle(double ratio, const GearTable& table, double theta) {
  return gear_output_angle(ratio, table, theta, theta / ratio);
}

double gear_output_angle(double ratio, const GearTable& table, double theta, double guess) {
  const auto function = [&](double phi, double& angle, double& slope) { relative(table, phi, angle, slope); };
  return invert(function, theta / ratio, farthest(table), guess);
}

void gear_derivatives(const Gear& gear, double direction, double phi, int highest, GearDerivatives& out) {
  GearDerivatives part;
  for (int k = 0; k <= highest; ++k) out.value[k] = 0.0;
  for (int side : {-1, 1}) {
    const double share = 0.5 * (1.0 + side * direction);
    if (share == 0.0) continue;
    gear_derivatives(1.0, side < 0 ? gear.cw : gear.ccw, phi, highest, part);
    for (int k = 0; k <= highest; ++k) out.value[k] += share * part.value[k];
  }
}

double gear_output_angle(const Gear& gear, double direction, double theta) {
  const double cw = 0.5 * (1.0 - direction), ccw = 0.5 * (1.0 + direction);
  const auto function = [&](double phi, double& angle, double& slope) {
    double other_angle = 0.0, other_slope = 0.0;
    angle = slope = 0.0;
    if (cw != 0.0) relative(gear.cw, phi, angle, slope);
    if (ccw != 0.0) relative(gear.ccw, phi, other_angle, other_slope);
    angle = cw * angle + ccw * other_angle;
    slope = cw * slope + ccw * other_slope;
  };
  return invert(function, theta, cw * farthest(gear.cw) + ccw * farthest(gear.ccw), theta);
}

bool gear_is_monotone(const GearTable& table, double* where) {
  double amplitude = 0.0, steepest = 0.0;
  for (long j = 0; j < table.size(); ++j) {
    const double size = std::hypot(table.a()[j], table.b()[j]);
    amplitude += size;
    steepest += size * table.order()[j];
  }
  if (amplitude < 1.0) return true;
  // |u'| <= steepest, so a positive value proves the stretch up to value / steepest.
  double angle, slope;
  long left = kMostEvaluations / table.size();
  for (double phi = -kRange; phi <= kRange; --left) {
    if (left == 0)
      throw InvalidArgument(
          "amplitudes of a gear table add to " + std::to_string(amplitude) + " at orders up to " +
          std::to_string(table.order().maxCoeff()) +
          ": too large and fine to tell whether the motor angle rises; expected a sum below 1");
    relative(table, phi, angle, slope);
    if (1.0 + slope <= 1e-6) {
      if (where) *where = phi;
      return false;
    }
    phi += (1.0 + slope) / steepest;
  }
  return true;
}

void require_gear(const std::string& name, double ratio, const GearTable& table) {
  if (!std::isfinite(ratio) || ratio == 0.0)
    throw InvalidArgument(name + ": ratio expected to be finite and not 0, found " + std::to_string(ratio));
  for (long j = 0; j < table.size(); ++j) {
    require_positive(name + ": order " + std::to_string(j + 1), table.order()[j]);
    require_finite(name + ": a of order " + std::to_string(table.order()[j]), table.a()[j]);
    require_finite(name + ": b of order " + std::to_string(table.order()[j]), table.b()[j]);
  }
  double where = 0.0;
  if (!gear_is_monotone(table, &where))
    throw InvalidArgument(
        name + ": the motor angle is not monotone in the output angle, the ratio turns negative at " +
        std::to_string(where) + " rad; expected harmonics that leave it positive");
}

GearTable gear_table(const Gear& gear, int direction) {
  if (direction < 0) return gear.cw;
  if (direction > 0) return gear.ccw;
  const long n_cw = gear.cw.size(), n_ccw = gear.ccw.size();
  const auto joined = [&](const Vector& cw, const Vector& ccw) {
    Vector both(n_cw + n_ccw);
    both.head(n_cw) = cw;
    both.tail(n_ccw) = ccw;
    return both;
  };
  return {joined(gear.cw.order(), gear.ccw.order()), joined(0.5 * gear.cw.a(), 0.5 * gear.ccw.a()),
          joined(0.5 * gear.cw.b(), 0.5 * gear.ccw.b())};
}

}  // namespace exactarm
