#include "exactarm/ocp/reach.hpp"

#include <cstdio>
#include <limits>

namespace exactarm::ocp {
namespace {

constexpr double kRounding = 1e-9;

double farthest(double rate, double acceleration, long steps) {
  double sum = 0.0;
  for (long k = 1; k < steps; ++k) sum += std::min(rate, acceleration * std::min(k, steps - k));
  return sum;
}

}  // namespace

std::string out_of_reach(const StageModel& model, const double* z) {
  const Layout& layout = model.layout();
  const int n = layout.axes, width = layout.width();
  Vector low(width), high(width);
  knot_bounds(model.problem(), low, high);
  const double* end = z + (layout.knots - 1) * width;
  for (const int angle : {static_cast<int>(kTheta), static_cast<int>(kQ)})
    for (int i = 0; i < n; ++i) {
      const int at = angle * n + i;
      // The link's acceleration has no bound.
      const double acceleration =
          angle == kTheta ? high[kThetaDdot * n + i] : std::numeric_limits<double>::infinity();
      const double distance = std::abs(end[at] - z[at]),
                   reach = farthest(high[at + n], acceleration, layout.knots - 1);
      if (distance <= (1.0 + kRounding) * reach) continue;
      char text[160];
      std::snprintf(text, sizeof text,
                    "joint %d has to turn %.4g rad in %.4g s, and its limits allow %.4g rad", i + 1, distance,
                    (layout.knots - 1) * model.problem().step, reach);
      return text;
    }
  return "";
}

}  // namespace exactarm::ocp
