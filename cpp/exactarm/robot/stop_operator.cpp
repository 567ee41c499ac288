#include "exactarm/robot/stop_operator.hpp"

#include <cmath>

#include "exactarm/base/check.hpp"

namespace exactarm {

void stop_operator(const double* motion, long count, double reach, double* memory, double* by_reach) {
  require_positive("reach of the stop operator", reach);
  double z = 0.0, slope = 0.0;  // dz / dreach: 0 until the first stop, then that of the last one
  for (long k = 0; k < count; ++k) {
    if (k) z += motion[k] - motion[k - 1];
    if (std::abs(z) >= reach) {
      slope = std::copysign(1.0, z);
      z = slope * reach;
    }
    memory[k] = z / reach;
    by_reach[k] = (slope - memory[k]) / reach;
  }
}

}  // namespace exactarm
